"""The tracked robot as a device among others: treads that run over struts on bellows, driven by one worm.

Spheres stand where a tread or the core may meet the wall: one at each strut tip, which carries the tread's law, and
some along the rest of each tread, which climbs folds and bends as a tank does. How far each tread has run is an
activation of its own, an integrator without a force, and so is what the treads ask of the worm, a filter: the state is
all MuJoCo's.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import Any, ClassVar

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from haustra.errors import InvalidDesignError, UnsupportedSceneError
from haustra.fields import choice, number, read_fields
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.base import (
    LOOK_AHEAD,
    Channel,
    Device,
    DeviceReadings,
    Handles,
    Pose,
    Reading,
    State,
    Treads,
    put,
)
from haustra.models.devices.tether import tether_tension
from haustra.models.devices.tracked.design import SCALE, TRACKS, TrackedDesign
from haustra.models.devices.tracked.device import Tracked, add_tracked, pad_stiffness
from haustra.models.devices.tracked.drive import WormState
from haustra.models.devices.tracked.loop import CORE_FRICTION
from haustra.models.devices.tracked.standing import nearest_fit, require_fit
from haustra.models.wall.planes import Sample

_SLIP = 1e-3
"""Speed below which the tether's drag fades, so that it holds and does not chatter [m/s]; engineering choice."""
_LARGEST_PRESS = 4.0
"""Largest force that may be commanded of a bellows, over its preload [1]; engineering choice."""
_WAYS = ("used_along", "used_around")
_FELT, _FILM, _AIR = TRACKS, TRACKS + 1, TRACKS + 3
"""Activations, after how far each tread ran: what they ask of the worm, what share of mu N they use, both ways, and the
pressure in each bellows over that of closed ones."""
_OWN = ("name", "rpm", "friction", "steering", "regulation")
_LARGEST_RPM = 1000.0
_SPACING = 1 / 8
"""Largest distance between spheres of a tread and of the core, over the core's length; engineering choice: beyond the
tips a tread meets folds and bends, whose radii are larger."""
_USUAL_START = 0.3
"""Where its nose stands at first [m]; engineering choice: in the sigmoid, which it fits."""
_TOUCH = 1e-9
"""Load of a tread that does not touch [N]."""
_LONGEST_STEP = 2e-3
"""Time step up to which pads stay on the wall [s]: at 5 ms wall forces are six times as large in a bend."""
_ANSWER = 0.1
"""Within which the worm answers to what the treads ask of it [s]; engineering choice: longer than the force that the
worm's droop leaves takes to bring the robot's mass to speed, some 50 ms, or both would swing."""
_FILM_ANSWER = 0.05
"""Within which the film between tread and wall answers to its friction [s]; engineering choice: much longer than what
it takes to slow the mass of the robot down, M ds/dF, some 5 ms, or both would swing."""
_LARGEST_SHARE = 2.0
"""Largest tread speed when steering, over the nominal [1]; the inner tread may stand but not run back."""


@dataclass(frozen=True, kw_only=True)
class TrackedRobot(Device):
    """A tracked robot and how its worm is run."""

    kind: ClassVar[str] = "tracked"
    has_treads: ClassVar[bool] = True
    left_out: ClassVar[Mapping[str, str]] = {
        "flexible shaft": "its losses, torque limit and drag count; its twist, its whirl and its pull on bends do not",
    }

    design: TrackedDesign
    rpm: float = number("1/min", 0.0, _LARGEST_RPM)
    """Speed of the worm [1/min]."""
    friction: float = number("1", 0.0, 2.0)
    """Coulomb's coefficient between treads and wall, where a run does not say otherwise [1]."""
    steering: str = choice("none", "each tread", default="none")
    """Whether treads have speeds of their own: the paper's device has one worm for all, each its own takes four
    motors."""
    regulation: str = choice("closed", "held", "each", default="closed")
    """What sets the pressure in the bellows: 'closed' off as the paper's, 'held' so that each track presses by its
    preload at any width, or by a force that is commanded for 'each' track."""

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], where: str) -> "TrackedRobot":
        """Worm speed, friction, steering, `at_scale`, and under `design` what differs from the published prototype."""
        rest = dict(table)
        scale = rest.pop("at_scale", None)
        own = {name: rest.pop(name) for name in _OWN if name in rest}
        table = {**own, "design": rest.pop("design", {}), **rest}
        found = read_fields(cls, table, where, error=InvalidDesignError)
        if scale is None:
            return found
        if said := SCALE.wrong(scale):
            raise InvalidDesignError(f"{where}: at_scale{said}; 1 is the device in practice.")
        return replace(found, design=found.design.at_scale(float(scale)))

    @property
    def usual(self) -> Mapping[str, Any]:
        """Its own friction and time step, and where it stands."""
        return {"friction": self.friction, "timestep": _LONGEST_STEP, "start_depth": _USUAL_START}

    def standing(self, colon: Colon, start: float) -> Pose:
        """Its core on the centreline, facing the caecum, its nose at `start` [m]."""
        arc = start - self._nose
        require_fit(colon, self.design, arc)
        line = colon.centreline
        place = np.array([np.interp(arc, line.arc, axis) for axis in line.points.T])
        return Pose(place, line.frames[int(np.searchsorted(line.arc, arc))], arc)

    def nearest_start(self, colon: Colon, start: float) -> float:
        """Arc length of the nose next to `start` [m] where the tracks reach the wall on both sides.

        Raises:
            InvalidDesignError: when it fits nowhere.
        """
        return nearest_fit(colon, self.design, start - self._nose) + self._nose

    @property
    def controls(self) -> tuple[Channel, ...]:
        """Speed of the worm, or of each tread as if it had a worm of its own; force of each bellows where they have."""
        treads = range(TRACKS) if self._steers else range(1)
        name = "tread_speed_{}" if self._steers else "worm_speed"
        speeds = tuple(Channel(name.format(n), "1/min", 0.0, _LARGEST_RPM, f"tracked/tread{n}") for n in treads)
        most = _LARGEST_PRESS * self.design.bellows.preload
        each = range(TRACKS) if self.regulation == "each" else ()
        return speeds + tuple(Channel(f"press_{n}", "N", 0.0, most, f"tracked/bellows{n}") for n in each)

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What worm and treads do."""
        return (
            Reading("worm_torque", "N m", "what the treads ask of the worm, which turns the core"),
            Reading("worm_share", "1", "worm speed over that asked for: below 1 its torque limit holds it back"),
            Reading("traction", "N", "friction of the wall on all treads along the core; forwards is positive"),
            Reading("normal", "N", "force of all treads on the wall"),
            Reading("core_force", "N", "force of the core on the wall"),
            Reading("tether_drag", "N", "what the tether pulls back with"),
            Reading("bellows_pressure", "Pa", "mean over the bellows, above that of the atmosphere"),
            Reading("width", "m", "from track to track, mean of both pairs"),
        )

    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """A robot whose core's centre stands at the pose, its tracks at their nominal width."""
        if timestep > _LONGEST_STEP:
            raise UnsupportedSceneError(
                f"A device of kind 'tracked' cannot honour a time step of {timestep:g} s: give up to "
                f"{_LONGEST_STEP:g} s."
            )
        spec.option.timestep = timestep
        normal, binormal, into = pose.frame.T
        tracked = add_tracked(
            spec,
            self.design,
            friction=self.friction,
            position=tuple(map(float, pose.position)),
            frame=np.column_stack([into, normal, binormal]),
            loops=True,
        )
        core = spec.body(tracked.core)
        # Forwards is x in the core, z in a tip's site.
        core.add_site(name="tracked/tip", pos=[self._nose, 0, 0], quat=[np.sqrt(0.5), 0, np.sqrt(0.5), 0])
        for track in range(TRACKS):
            run = spec.add_actuator(name=f"tracked/tread{track}", target=f"tracked/strut{track}")
            run.trntype, run.dyntype = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtDyn.mjDYN_INTEGRATOR
            run.gainprm = [0.0] * 10
        for name, within in (("felt", _ANSWER), *((way, _FILM_ANSWER) for way in _WAYS)):
            felt = spec.add_actuator(name=f"tracked/{name}", target="tracked/centre", trntype=mujoco.mjtTrn.mjTRN_SITE)
            felt.dyntype, felt.dynprm, felt.gainprm = mujoco.mjtDyn.mjDYN_FILTEREXACT, [within] + [0.0] * 9, [0.0] * 10
        own = self.design.bellows
        for track in range(TRACKS):
            press = spec.add_actuator(name=f"tracked/bellows{track}", target=f"tracked/strut{track}")
            press.trntype, press.dyntype = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtDyn.mjDYN_FILTEREXACT
            press.dynprm, press.gainprm = [max(own.response, timestep)] + [0.0] * 9, [-own.area] + [0.0] * 9
        # A damper along the core at its rear whose coefficient is the control: MuJoCo is implicit in it.
        tether = spec.add_actuator(name="tracked/tether", target=tracked.tow, trntype=mujoco.mjtTrn.mjTRN_SITE)
        tether.gear, tether.gaintype = [1, 0, 0, 0, 0, 0], mujoco.mjtGain.mjGAIN_AFFINE
        tether.gainprm = [0, 0, -1] + [0.0] * 7
        samples = tuple(sphere for sphere, _, _ in self._spheres(tracked))
        struts = tuple(f"tracked/strut{track}" for track in range(TRACKS))
        pads = tuple(pad.geom for pad in tracked.pads)
        geoms = (tracked.core, *pads, *(part.geom for part in tracked.loops))
        return Handles((tracked.core, *struts, *pads), samples, geoms, "tracked/tip", start)

    def control(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Any:
        """Speed of treads, tooth phase over each tip, the worm's torque on the core, air in bellows, tether's drag."""
        tracked = self._tracked
        controls = xp.zeros((len(commands), model.nu))
        speed = self._forwards(xp, model, state)
        damper = xp.where(speed > 0, self._tension(xp, state) / xp.maximum(speed, _SLIP), 0.0)  # it cannot push
        asked = {
            ("felt",): self._traction(xp, state)[:, None],
            tuple(f"tread{n}" for n in range(TRACKS)): self._speeds(xp, state, commands),
            _WAYS: self._used(xp, state),
            tuple(f"bellows{n}" for n in range(TRACKS)): self._air(xp, model, state, commands),
            ("tether",): damper[:, None],
        }
        for names, values in asked.items():
            controls = put(xp, controls, [model.actuator(f"tracked/{name}").id for name in names], values)
        phases = tracked.phase_controls_each(state.act[:, :TRACKS], xp=xp)
        controls = put(xp, controls, [model.actuator(pad.actuator).id for pad in tracked.pads], phases)
        return put(xp, controls, [model.actuator(tracked.roll_motor).id], self._worm(xp, state).torque[:, None])

    def treads(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Treads:
        """Surfaces run backwards, less what the film between tread and wall slides; shaft losses take from friction.

        What drives them is the worm's torque by the speed that it turns with, losses in the worm and all.

        Friction F of all treads slides at the speed where mu(v) is F / N (`SpeedFriction`): what Coulomb's law holds is
        the film's outer side, which runs so much slower than the tread, and around the core as that is turned.
        """
        speeds, (_, tracks, directions) = self._speeds(xp, state, commands), self._layout
        on_tread = tracks >= 0
        each = xp.where(on_tread, speeds[:, tracks], 0.0)
        turning = xp.abs(speeds).max(axis=1) / self.design.worm.lead * math.tau
        own = self.design.shaft.transmission(turning, xp=xp)[:, None]
        used = state.act[:, _FILM : _FILM + len(_WAYS)]
        size = xp.maximum(xp.sqrt((used**2).sum(axis=1, keepdims=True)), _TOUCH)
        film = self.design.speed_friction.sliding(size / xp.maximum(own, _TOUCH), xp=xp) / size * used
        along, around = (xp.where(on_tread, film[:, way : way + 1], 0.0) for way in range(len(_WAYS)))
        surface = (along - each)[..., None] * directions + around[..., None] * np.array([0.0, 1.0, 0.0])
        worm = self._worm(xp, state).torque * speeds.mean(axis=1) / self.design.worm.lead * math.tau
        return Treads(surface, xp.where(on_tread, own, 1.0), worm)

    def read(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State) -> dict[str, Any]:
        """Each of `readings`, (worlds,)."""
        worm, on_tread = self._worm(xp, state), self._layout[1] >= 0
        return {
            "worm_torque": worm.torque,
            "worm_share": worm.speed_share,
            "traction": self._traction(xp, state),
            "normal": _over(xp, on_tread, state.pressed),
            "core_force": _over(xp, ~on_tread, state.pressed),
            "tether_drag": -state.actuator_force[:, model.actuator("tracked/tether").id],
            "bellows_pressure": self.design.bellows.pressure + state.act[:, _AIR : _AIR + TRACKS].mean(axis=1),
            "width": self.design.nominal_diameter + 2 * self._struts(model, state).mean(axis=1),
        }

    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """The worm at its speed; treads that have their own turn towards the lumen ahead."""
        press = xp.full((len(seen.time), len(self.controls) - (TRACKS if self._steers else 1)), 0.0)
        press = press + self.design.bellows.preload
        if not self._steers:
            return xp.concatenate([xp.full((len(seen.time), 1), self.rpm), press], axis=1), memory
        ahead = xp.einsum("wji,wj->wi", seen.tip_frame, LOOK_AHEAD * seen.ahead)
        forwards, side = self._nose + ahead[:, 2], ahead[:, :2]
        # The circle along the core's axis through the target has curvature 2 y / d^2 (Coulter 1992, pure pursuit).
        curvature = 2 * side / (forwards**2 + (side**2).sum(axis=1))[:, None]
        azimuth = math.tau * np.arange(TRACKS) / TRACKS
        # Of each track in the tip's frame, whose x is down and y left: track 0 is up.
        outwards = np.stack([-np.cos(azimuth), -np.sin(azimuth)])
        share = 1 - self.design.nominal_diameter / 2 * curvature @ outwards
        return xp.concatenate([self.rpm * xp.clip(share, 0.0, _LARGEST_SHARE), press], axis=1), memory

    @property
    def _steers(self) -> bool:
        return self.steering != "none"

    @property
    def _nose(self) -> float:
        """Distance of the tip from the core's centre [m]."""
        return (self.design.core_length + self.design.core_diameter) / 2

    @cached_property
    def _tracked(self) -> Tracked:
        """Names of its parts."""
        return add_tracked(mujoco.MjSpec(), self.design, friction=self.friction, loops=True)

    @cached_property
    def _layout(self) -> tuple[tuple[Sample, ...], np.ndarray, Float[np.ndarray, "spheres 3"]]:
        """Spheres, the track of each, -1 for the core's, and which way its tread runs forwards."""
        spheres, tracks, directions = zip(*self._spheres(self._tracked), strict=True)
        return spheres, np.array(tracks), np.array(directions)

    def _spheres(self, tracked: Tracked) -> list[tuple[Sample, int, np.ndarray]]:
        design, forwards = self.design, np.array([1.0, 0.0, 0.0])
        ball, most = design.tread.width / 2, _SPACING * design.core_length
        stiffness = pad_stiffness(design)
        found = [
            (Sample(pad.geom, np.zeros(3), ball, stiffness=stiffness), pad.track, forwards) for pad in tracked.pads
        ]
        for part in tracked.loops:
            rear, front = np.array(part.rear), np.array(part.front)
            along = (front - rear) / np.linalg.norm(front - rear)
            count = math.ceil(np.linalg.norm(front - rear) / most) + 1
            found += [(Sample(part.body, place, ball), part.track, along) for place in np.linspace(rear, front, count)]
        half, radius = design.core_length / 2, design.core_diameter / 2
        places = np.linspace(-half, half, math.ceil(1 / _SPACING / 2) + 1)
        return found + [
            (Sample(tracked.core, place * forwards, radius, friction=CORE_FRICTION), -1, forwards) for place in places
        ]

    def _worm(self, xp: ModuleType, state: State) -> WormState:
        return WormState.under(self.design, state.act[:, _FELT], xp=xp)

    def _speeds(self, xp: ModuleType, state: State, commands: Any) -> Any:
        """Speeds of the treads (worlds, tracks) [m/s]: as asked, as far as the worm's torque goes."""
        asked = self.design.tread_speed(1.0) * xp.clip(commands[:, : TRACKS if self._steers else 1], 0.0, _LARGEST_RPM)
        return xp.broadcast_to(asked * self._worm(xp, state).speed_share[:, None], (len(commands), TRACKS))

    def _air(self, xp: ModuleType, model: mujoco.MjModel, state: State, commands: Any) -> Any:
        """Pressure that each bellows' regulator asks for, over that of the closed bellows (worlds, tracks) [Pa]."""
        own = self.design.bellows
        if self.regulation == "closed":
            return xp.zeros((len(commands), TRACKS))
        press = xp.full((len(commands), TRACKS), own.preload) if self.regulation == "held" else commands[:, -TRACKS:]
        return own.regulated(self._struts(model, state), press, xp=xp) - own.pressure

    def _tension(self, xp: ModuleType, state: State) -> Any:
        """Tension of a tether as long as the way from the anus to the robot's rear (worlds,) [N]."""
        own, length = self.design.tether, state.tip_arc - 2 * self._nose
        law = {"friction": own.friction, "mass_per_length": own.mass_per_length, "held": own.held}
        return tether_tension(xp, state.bends, length, **law)

    def _forwards(self, xp: ModuleType, model: mujoco.MjModel, state: State) -> Any:
        """Speed of the core along itself (worlds,) [m/s]."""
        first = int(model.joint("tracked/free").dofadr[0])
        return xp.einsum("wi,wi->w", state.qvel[:, first : first + 3], state.tip_frame[..., 2])

    def _struts(self, model: mujoco.MjModel, state: State) -> Any:
        """How far each track is out from its nominal radius (worlds, tracks) [m]."""
        places = [int(model.joint(f"tracked/strut{n}").qposadr[0]) for n in range(TRACKS)]
        return state.qpos[:, np.array(places)]

    def _used(self, xp: ModuleType, state: State) -> Any:
        """Friction on all treads over the largest, along the core and around it (worlds, 2) [1]."""
        on_tread, azimuth = self._layout[1] >= 0, math.tau * self._layout[1] / TRACKS
        # The tip's frame is down, left and forwards of the core.
        down, left, forwards = xp.moveaxis(xp.einsum("wsi,wij->wsj", state.rubbed, state.tip_frame), 2, 0)
        around = np.cos(azimuth) * left - np.sin(azimuth) * down
        most = _over(xp, on_tread, state.friction * state.pressed)
        both = xp.stack([_over(xp, on_tread, way) for way in (forwards, around)], axis=1)
        return both / xp.maximum(most, _TOUCH)[:, None]

    def _traction(self, xp: ModuleType, state: State) -> Any:
        """Friction of the wall on all treads along the core (worlds,), as of the last step [N]."""
        along = xp.einsum("wsi,wi->ws", state.rubbed, state.tip_frame[..., 2])
        return _over(xp, self._layout[1] >= 0, along)


def _over(xp: ModuleType, chosen: Bool[np.ndarray, " spheres"], values: Any) -> Any:
    """Sum over chosen spheres (worlds,), in an order that does not depend on how many worlds there are."""
    return xp.where(chosen, values, 0.0).sum(axis=1)


DEVICE = TrackedRobot
