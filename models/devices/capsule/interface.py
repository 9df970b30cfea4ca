"""A tethered magnetic capsule: a free body, six contact spheres along its axis, led by a magnet or by a wrench.

What leads it is a magnet outside the patient, whose pose is the control and which acts as a dipole on that in the
capsule (`haustra.models.devices.capsule.magnet`), or any force and torque within limits. The tether is a drag on the
rear end: friction of what has been drawn in, and what it is wound round (`haustra.models.devices.tether`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, ClassVar

import mujoco
import numpy as np

from haustra.errors import InvalidDesignError
from haustra.fields import choice, number
from haustra.models.devices.base import (
    Channel,
    Device,
    DeviceReadings,
    Handles,
    Pose,
    Reading,
    State,
    add_wrench,
    put,
)
from haustra.models.devices.capsule.driver import drive, lead
from haustra.models.devices.capsule.magnet import dipole_wrench
from haustra.models.devices.tether import tether_tension
from haustra.models.wall.planes import Sample

SPHERES = 6
_TINY = 1e-9
_TETHER_RADIUS = 1.25e-3
"""As the tether is drawn [m]."""
_LEAST_SHAFT = 1e-4
"""Between the two round ends [m]: MuJoCo takes no shorter capsule, and spheres on one spot say nothing of turning."""
_SLIP = 2e-3
"""Speed below which the tether's drag fades, so that it holds and does not chatter [m/s]; engineering choice."""
_AXES = tuple(f"{what}_{axis}" for what in ("force", "torque") for axis in "xyz")
_MAGNET = tuple(f"magnet_{what}{axis}" for what in ("", "points_") for axis in "xyz")
_FURTHEST = 2.0
"""How far from the anus along each axis the magnet may be [m]: beyond any patient."""


@dataclass(frozen=True, kw_only=True)
class Capsule(Device):
    """Numbers of a tethered magnetic capsule, in SI units."""

    kind: ClassVar[str] = "capsule"
    left_out: ClassVar[Mapping[str, str]] = {
        "arm that holds the magnet": "the magnet is where it is asked to be at once, anywhere further than `standoff` "
        "from the capsule: the patient's skin, and what an arm reaches, do not hold it back",
        "tether": "a drag at the capsule: its stiffness, and its pull on the wall in bends, are not modelled",
        "grip of a collapsed bowel": "the lumen stands open; `drag` is what slows the body in it",
    }

    length: float = number("m", 0.006, 0.06)
    """Length over both round ends [m]."""
    diameter: float = number("m", 0.004, 0.03)
    """Diameter of the body [m]."""
    mass: float = number("kg", 1e-3, 0.1)
    """Mass of the body, without its tether [kg]."""
    drag: float = number("N s/m", 0.1, 200.0)
    """Drag of the lumen's mucus: force over speed [N s/m]."""
    turning_drag: float = number("N m s/rad", 1e-5, 0.1)
    """Drag of the mucus on turning: torque over turning rate [N m s/rad]."""
    force_limit: float = number("N", 0.0, 10.0)
    """Largest force along each axis [N]."""
    torque_limit: float = number("N m", 0.0, 0.5)
    """Largest torque about each axis [N m]."""
    tether_mass_per_length: float = number("kg/m", 0.0, 0.1)
    """Mass per length of the tether [kg/m]."""
    tether_friction: float = number("1", 0.0, 2.0)
    """Coulomb's coefficient between tether and wall [1]."""
    tether_held: float = number("N", 0.0, 5.0, default=0.0)
    """Tension with which the tether is paid out outside the patient [N]."""
    safe_force: float = number("N", 0.05, 20.0)
    """Wall force beyond which the driver backs off [N]."""
    frame: str = choice("patient", "own", default="patient")
    """Axes of force and torque of a wrench: the patient's, or the body's own."""
    led_by: str = choice("wrench", "magnet", default="wrench")
    """What its controls are: force and torque, or the pose of a magnet outside the patient."""
    moment: float = number("A m^2", 0.0, 100.0, default=0.0)
    """Size of the dipole moment of the magnet in it, which points forwards along its axis [A m^2]."""
    outside_moment: float = number("A m^2", 0.0, 1e5, default=0.0)
    """Size of the dipole moment of the magnet outside the patient [A m^2]."""
    standoff: float = number("m", 0.02, 1.0, default=0.15)
    """Least distance between both magnets: abdominal wall, and half of the outer one [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.length < self.diameter + _LEAST_SHAFT:
            raise InvalidDesignError(
                f"Device '{self.name}': length is {self.length} m; give at least the diameter and "
                f"{_LEAST_SHAFT * 1e3:g} mm, {self.diameter + _LEAST_SHAFT:g} m."
            )
        if self._magnetic and not (self.moment and self.outside_moment):
            raise InvalidDesignError(f"Device '{self.name}' is led by a magnet: give its moment and outside_moment.")

    @property
    def controls(self) -> tuple[Channel, ...]:
        """Place of the magnet outside and the direction of its moment, or force and torque."""
        if self._magnetic:
            limits, names = [("m", _FURTHEST)] * 3 + [("1", 1.0)] * 3, _MAGNET
        else:
            limits, names = [("N", self.force_limit)] * 3 + [("N m", self.torque_limit)] * 3, _AXES
        pairs = zip(names, limits, strict=True)
        return tuple(Channel(name, unit, -limit, limit, self._name(name)) for name, (unit, limit) in pairs)

    @property
    def in_patient_axes(self) -> bool:
        """A magnet outside, or a wrench in the patient's axes."""
        return self._magnetic or self.frame == "patient"

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What the magnet and the tether do."""
        return (
            Reading("magnet_force", "N", "size of the magnet's force"),
            Reading("tether_drag", "N", "what the tether pulls back with"),
            Reading("speed", "m/s", "of the body"),
        )

    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """A body on three slides and a ball, which is free and lets the mucus resist motion and turning apart."""
        radius, half = self.diameter / 2, max(self.length - self.diameter, 0.0) / 2
        into, quaternion = pose.frame[:, 2], np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose.frame, float).ravel())
        place = pose.position + (start - half - radius) * into
        body = spec.worldbody.add_body(name=self._name("body"), pos=place, quat=quaternion)
        # MuJoCo's contacts see inertia and not the drag, which is many times the inertia over a time step: without an
        # armature of that order a body that is pressed on the wall would not come to rest.
        for axis, name in zip(np.eye(3), "xyz", strict=True):
            slide = {"type": mujoco.mjtJoint.mjJNT_SLIDE, "axis": axis, "armature": self.drag * timestep}
            body.add_joint(name=self._name(f"slide_{name}"), damping=[self.drag, 0, 0], **slide)
        ball = {"type": mujoco.mjtJoint.mjJNT_BALL, "armature": self.turning_drag * timestep}
        body.add_joint(name=self._name("ball"), damping=[self.turning_drag, 0, 0], **ball)
        body.add_geom(
            name=self._name("shell"),
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0, 0, -half, 0, 0, half],
            size=[radius, 0, 0],
            mass=self.mass,
            contype=0,
            conaffinity=1,
            rgba=[0.9, 0.9, 0.95, 1],
        )
        body.add_site(name=self._name("tip"), pos=[0, 0, half + radius])
        body.add_site(name=self._name("centre"))
        body.add_site(name=self._name("rear"), pos=[0, 0, -half - radius])
        frame = "patient" if self._magnetic else self.frame
        add_wrench(spec, self._name("centre"), tuple(map(self._name, _AXES)), frame=frame)
        for name in _MAGNET if self._magnetic else ():  # without a force: its control says where the magnet is
            still = spec.add_actuator(name=self._name(name), target=self._name("slide_x"))
            still.trntype, still.gainprm = mujoco.mjtTrn.mjTRN_JOINT, [0.0] * 10
        # A damper along the axis at the rear end whose coefficient is the control: MuJoCo is implicit in it.
        spec.add_actuator(
            name=self._name("tether"),
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            target=self._name("rear"),
            gear=[0, 0, 1, 0, 0, 0],
            gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
            gainprm=[0, 0, -1] + [0] * 7,
        )
        samples = tuple(
            Sample(self._name("body"), np.array([0, 0, along]), radius) for along in np.linspace(-half, half, SPHERES)
        )
        _draw(body, self._name, half, radius)
        trail = self._name("rear"), _TETHER_RADIUS
        return Handles((self._name("body"),), samples, (self._name("shell"),), self._name("tip"), start, trail)

    def control(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Any:
        """The wrench, and the tether's drag over the speed at which it is drawn in."""
        controls = super().control(xp, model, handles, state, commands)
        if self._magnetic:
            place, moment = self._magnet(xp, model, state, controls)
            force, torque = dipole_wrench(
                xp, moment, self.moment * state.tip_frame[..., 2], self._centre(xp, model, state) - place
            )
            columns = [model.actuator(self._name(name)).id for name in (*_MAGNET[:3], *_AXES)]
            controls = put(xp, controls, columns, xp.concatenate([place, force, torque], axis=1))
        along = xp.abs(xp.einsum("wi,wi->w", self._speed(xp, model, state), state.tip_frame[..., 2]))
        damper = self._tether(xp, state) / xp.maximum(along, _SLIP)
        return put(xp, controls, [model.actuator(self._name("tether")).id], damper[:, None])

    def read(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State) -> dict[str, Any]:
        """Each of `readings`, (worlds,)."""
        force = state.actuator_force[:, [model.actuator(self._name(name)).id for name in _AXES[:3]]]
        return {
            "magnet_force": xp.sqrt((force**2).sum(axis=1)),
            "tether_drag": xp.abs(state.actuator_force[:, model.actuator(self._name("tether")).id]),
            "speed": xp.sqrt((self._speed(xp, model, state) ** 2).sum(axis=1)),
        }

    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """Pull along the lumen's axis ahead; back off while the wall presses too hard."""
        if self._magnetic:
            moments, half = (self.outside_moment, self.moment), self.length / 2
            return lead(xp, seen, memory, moments, self.force_limit, self.standoff, half, safe_force=self.safe_force)
        limits = self.force_limit, self.torque_limit
        return drive(xp, seen, memory, limits=limits, safe_force=self.safe_force, own_frame=self.frame == "own")

    @property
    def _magnetic(self) -> bool:
        return self.led_by == "magnet"

    def _magnet(self, xp: ModuleType, model: mujoco.MjModel, state: State, controls: Any) -> tuple[Any, Any]:
        """Where the magnet outside is, at least `standoff` from the capsule (worlds, 3) [m], and its moment [A m^2]."""
        asked, points = (
            controls[:, [model.actuator(self._name(name)).id for name in names]] for names in (_MAGNET[:3], _MAGNET[3:])
        )
        centre = self._centre(xp, model, state)
        away = asked - centre
        distance = xp.sqrt((away**2).sum(axis=1, keepdims=True)) + _TINY
        place = centre + away / distance * xp.maximum(distance, self.standoff)
        return place, self.outside_moment * points / (xp.sqrt((points**2).sum(axis=1, keepdims=True)) + _TINY)

    def _tether(self, xp: ModuleType, state: State) -> Any:
        """Tension of a tether as long as the way that the tip has come [N]."""
        return tether_tension(
            xp,
            state.bends,
            state.tip_arc,
            friction=self.tether_friction,
            mass_per_length=self.tether_mass_per_length,
            held=self.tether_held,
        )

    def _centre(self, xp: ModuleType, model: mujoco.MjModel, state: State) -> Any:
        """Middle of the body in the scene's axes (worlds, 3) [m]."""
        places = [int(model.joint(self._name(f"slide_{axis}")).qposadr[0]) for axis in "xyz"]
        return model.body(self._name("body")).pos + state.qpos[:, places] @ self._entry(model).T

    def _speed(self, xp: ModuleType, model: mujoco.MjModel, state: State) -> Any:
        """Velocity of the body in the scene's axes (worlds, 3) [m/s]; its slides lie along the axes of entry."""
        dofs = [int(model.joint(self._name(f"slide_{axis}")).dofadr[0]) for axis in "xyz"]
        return state.qvel[:, dofs] @ self._entry(model).T

    def _entry(self, model: mujoco.MjModel) -> np.ndarray:
        """Axes of entry, along which the slides lie."""
        entry = np.empty(9)
        mujoco.mju_quat2Mat(entry, model.body(self._name("body")).quat)
        return entry.reshape(3, 3)

    def _name(self, part: str) -> str:
        return f"{self.kind}/{part}"


def _draw(body: mujoco.MjsBody, name: Callable[[str], str], half: float, radius: float) -> None:
    """Add what a picture shows beside the shell: the magnet's band, a dome with the lens in it, and lamps."""
    plain = {"contype": 0, "conaffinity": 0, "mass": 0.0}
    band = {"type": mujoco.mjtGeom.mjGEOM_CYLINDER, "fromto": [0, 0, -0.6 * half, 0, 0, 0.6 * half]}
    body.add_geom(name=name("band"), size=[1.01 * radius, 0, 0], rgba=[0.25, 0.35, 0.55, 1], **band, **plain)
    balls = [("lens", 0.0, 0.78, 0.28, [0.1, 0.12, 0.2, 1]), ("lamp_left", 0.5, 0.72, 0.16, [1, 0.97, 0.8, 1])]
    balls += [("lamp_right", -0.5, 0.72, 0.16, [1, 0.97, 0.8, 1])]
    for part, side, along, size, colour in balls:
        place = [side * radius, 0, half + along * radius]
        body.add_geom(name=name(part), pos=place, size=[size * radius, 0, 0], rgba=colour, **plain)


DEVICE = Capsule
