"""The tracked robot as a device among others. Its treads meet walls of pieces only: their law stands in their pads."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, ClassVar

import mujoco
import numpy as np

from haustra.errors import InvalidDesignError
from haustra.models.devices.base import (
    Channel,
    Device,
    DeviceReadings,
    Handles,
    Pose,
    Reading,
    choice,
    number,
    read_fields,
)
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.device import add_tracked

_OWN = ("name", "rpm", "friction", "steering")


@dataclass(frozen=True, kw_only=True)
class TrackedRobot(Device):
    """A tracked robot and how its worm is run."""

    kind: ClassVar[str] = "tracked"
    walls: ClassVar[tuple[str, ...]] = ("pieces",)
    left_out: ClassVar[Mapping[str, str]] = {
        "friction by speed": "treads rub by their nominal coefficient at any speed of sliding",
        "flexible shaft": "its losses and torque limit count; its twist, its whirl and its drag in the colon do not",
        "mesentery": "the colon gives way by its wall's stiffness only; sigmoid and transverse colon do not swing",
        "weight": "as in the paper",
    }

    design: TrackedDesign
    rpm: float = number("1/min", 0.0, 1000.0)
    """Worm speed."""
    friction: float = number("1", 0.0, 2.0)
    """Coulomb's coefficient between treads and wall, where a run does not say otherwise."""
    steering: str = choice("none", "each tread", default="none")
    """The paper's device has one worm for all treads; each at its own speed (`AxisSteering`) needs four motors."""

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], where: str) -> "TrackedRobot":
        """Worm speed, friction, steering, `at_scale`, and under `design` what differs from the published prototype."""
        rest = dict(table)
        scale = rest.pop("at_scale", None)
        own = {name: rest.pop(name) for name in _OWN if name in rest}
        found = read_fields(cls, {**own, "design": rest.pop("design", {}), **rest}, where)
        if scale is None:
            return found
        if not isinstance(scale, int | float) or isinstance(scale, bool):
            raise InvalidDesignError(f"{where}, at_scale: expected a number, found {scale!r}.")
        return replace(found, design=found.design.at_scale(float(scale)))

    @property
    def controls(self) -> tuple[Channel, ...]:
        """The worm. Treads run by their geoms' surface velocity, which is no actuator: the run sets it."""
        return (Channel("worm_speed", "1/min", 0.0, 1000.0, ""),)

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What worm and treads do."""
        return (
            Reading("worm_torque", "N m", "what the treads ask of the worm, which turns the core"),
            Reading("worm_share", "1", "worm speed over that asked for: below 1 its torque limit holds it back"),
            Reading("normal", "N", "force of all treads on the wall"),
            Reading("core_force", "N", "force of the core on the wall"),
        )

    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """A robot with its nose at the start, its tracks at their nominal width."""
        spec.option.timestep = timestep
        normal, binormal, into = pose.frame.T
        half = self.design.core_length / 2
        centre = pose.position + (start - half) * into
        tracked = add_tracked(
            spec,
            self.design,
            friction=self.friction,
            position=tuple(map(float, centre)),
            frame=np.column_stack([into, normal, binormal]),
            loops=True,
        )
        core = spec.body(tracked.core)
        # Forwards is x in the core, z in a tip's site.
        core.add_site(name="tracked/tip", pos=[half, 0, 0], quat=[np.sqrt(0.5), 0, np.sqrt(0.5), 0])
        struts = tuple(f"tracked/strut{track}" for track in range(TRACKS))
        geoms = (tracked.core, *(part.geom for part in (*tracked.pads, *tracked.loops)))
        return Handles((tracked.core, *struts), (), geoms, "tracked/tip", start)

    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """A worm at its speed."""
        return xp.full((len(seen.time), 1), self.rpm), memory


DEVICE = TrackedRobot
