"""A scope as a device among others: `add_scope` behind the common interface, with ideal wires.

`haustra run` drives scopes by the lumen follower, in scenes of their own (`haustra.models.scene`). This is how a scope
enters whatever takes any device.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, ClassVar

import mujoco
import numpy as np

from haustra.assets import asset
from haustra.errors import InvalidDesignError, UnsupportedSceneError
from haustra.fields import number, read_fields, whole
from haustra.models.devices.base import Channel, Device, DeviceReadings, Handles, Pose, Reading, State, put
from haustra.models.devices.scope.cable import LOCK_STRETCH, PULL_OUT_LIMIT, add_scope
from haustra.models.devices.scope.cells import Cell, cut_into_cells
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import DESIGN_NAMES, named_design
from haustra.models.devices.scope.stops import apply_stops
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.wall.planes import capsule_samples
from haustra.quantity import load_quantities

_USUAL = "adult"
"""What is meant by a scope of no name."""
_ADVANCE, _BACK = 0.03, -0.02
"""Speeds of the hand [m/s]; engineering choice."""
_SAFE_FORCE = 10.0
"""Wall force on one link beyond which the driver pulls back [N]; engineering choice."""
_GAIN = 1.0
"""Bend that is steered for over the angle between tip and lumen ahead [1]; engineering choice."""
_SPACING = 0.75
"""Spacing of the spheres that meet the wall, over the diameter [1], as in `haustra.models.scene`."""


@dataclass(frozen=True, kw_only=True)
class Scope(Device):
    """A scope design, and how finely it is modelled."""

    kind: ClassVar[str] = "scope"
    is_shaft: ClassVar[bool] = True
    left_out: ClassVar[Mapping[str, str]] = {
        "wires": "pulls arrive at the tip as they are asked for: slack, stretch and friction need the follower's runs"
    }

    design: ScopeDesign
    shaft_cell: float = number("m", 0.002, 1.0, default=0.05)
    """Largest distance between joints of the shaft [m]."""
    bending_cell: float = number("m", 0.001, 0.5, default=0.017)
    """Largest distance between joints of the bending section [m]."""
    twist_hinges: int = whole(0, 200, default=4)
    """Number of hinges that carry the torsional compliance of the whole scope; 0 for stiff in torsion."""
    inserted: float | None = number("m", 0.01, 10.0, default=None)
    """Length of scope that is modelled [m]; the whole scope when None."""

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], where: str) -> "Scope":
        """A scope from its design's file."""
        design = read_fields(ScopeDesign, table, where, error=InvalidDesignError)
        return cls(name=design.name, design=design)

    @classmethod
    def named(cls, name: str) -> "Scope | None":
        """A shipped scope; 'scope' is the adult one."""
        design = _USUAL if name == cls.kind else name
        return cls(name=name, design=named_design(design)) if design in DESIGN_NAMES else None

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of shipped scopes."""
        return (*DESIGN_NAMES, cls.kind)

    @property
    def controls(self) -> tuple[Channel, ...]:
        """Hand and wires."""
        pull = self.design.wires.pull_limit
        return (
            Channel("push_rate", "m/s", -PULL_OUT_LIMIT, PULL_OUT_LIMIT, "scope/push"),
            Channel("roll_rate", "rad/s", -2 * np.pi, 2 * np.pi, "scope/roll"),
            *(Channel(f"pull_{name}", "N", 0.0, pull, f"scope/pull_{name}") for name in WIRE_NAMES),
        )

    @property
    def view_deg(self) -> float:
        """The field of view of its tip."""
        return self.design.tip.field_of_view_deg

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What the hand feels."""
        return (
            Reading("push_force", "N", "force of the hand along the shaft"),
            Reading("torque", "N m", "torque of the hand about the shaft"),
            Reading("insertion", "m", "scope past the anus"),
        )

    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """A straight scope, its tip past the anus.

        Raises:
            UnsupportedSceneError: when the wires have friction or hysteresis, which only single runs honour.
        """
        for name in ("friction", "hysteresis"):
            if getattr(self.design.wires, name):
                raise UnsupportedSceneError(
                    f"Scope '{self.name}' has wires.{name}, which scenes of any device do not honour: set it to 0."
                )
        limits = load_quantities(asset("numbers/contact.toml"))
        cable = add_scope(
            spec,
            self.design,
            self._cells,
            entry=pose.position,
            frame=pose.frame,
            inserted=start,
            twist_hinges=self.twist_hinges,
            push_limit=limits["contact.push_force_peak"].value,
            torque_limit=limits["contact.torque_peak"].value,
            timestep=timestep,
            cubic=False,
        )
        bare = spec.compile()
        apply_stops(spec, bare, timestep=timestep)
        samples = capsule_samples(bare, cable.geoms, spacing=_SPACING * self.design.diameter)
        return Handles(cable.links, samples, cable.geoms, "scope/tip", start)

    def control(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Any:
        """Hand and wires; joints outside the patient are held straight, and freed smoothly as they pass the anus."""
        controls = super().control(xp, model, handles, state, commands)
        cells = self._cells
        length = cells[-1].start + cells[-1].length + self.design.tip.length
        behind = length - np.array([cell.joint for cell in cells])
        outside = behind - self._insertion(model, handles, state)[:, None]
        held = xp.clip(outside / LOCK_STRETCH, 0.0, 1.0) ** 4
        for side in "xy":
            columns = [model.actuator(f"scope/lock_{side}_{index:03d}").id for index in range(len(cells))]
            controls = put(xp, controls, columns, held)
        return controls

    def read(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State) -> dict[str, Any]:
        """Each of `readings`, (worlds,)."""
        force = state.actuator_force
        return {
            "push_force": force[:, model.actuator("scope/push").id],
            "torque": force[:, model.actuator("scope/roll").id],
            "insertion": self._insertion(model, handles, state),
        }

    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """Push, the tip bent towards the lumen's axis ahead; pull back while the wall presses too hard."""
        local = xp.einsum("wij,wi->wj", seen.tip_frame, seen.ahead)
        across = xp.maximum(xp.sqrt((local[:, :2] ** 2).sum(axis=1)), 1e-9)
        bend = _GAIN * (xp.arctan2(across, local[:, 2]) / across)[:, None] * local[:, :2] * self.design.pull_per_angle
        pulls = xp.maximum(xp.concatenate([bend, -bend], axis=1), 0.0)
        push = xp.where(seen.wall_force > _SAFE_FORCE, _BACK, _ADVANCE)
        return xp.concatenate([push[:, None], xp.zeros_like(push)[:, None], pulls], axis=1), memory

    @cached_property
    def _cells(self) -> tuple[Cell, ...]:
        length = self.design.length if self.inserted is None else min(self.design.length, self.inserted)
        return cut_into_cells(self.design, shaft_cell=self.shaft_cell, bending_cell=self.bending_cell, length=length)

    def _insertion(self, model: mujoco.MjModel, handles: Handles, state: State) -> Any:
        """Length of scope past the anus (worlds,) [m]."""
        return handles.start + state.qpos[:, int(model.joint("scope/push").qposadr[0])]


DEVICE = Scope
