"""A two-anchor inchworm: two balloons on a body that extends, a joint behind each, and a tether.

A balloon is a ring of pads on radial slides. Pressure p pushes each outwards by p times its share of the balloon's
side, up to the balloon's largest diameter; what the wall gives back is friction. In each cycle the rear balloon holds
while the body extends by its stroke, then the front one holds while it contracts, so that the step is

    step = stroke - slip of both anchors,

where an anchor that carries the force F under the normal force N creeps at v_s F / (mu N) while it holds, by the
contact law's own slip speed v_s (`haustra.models.wall.law`), and slides where F is more than mu N. F is the drag of
what moves, and the tether's tension (`haustra.models.devices.tether`).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, ClassVar

import mujoco
import numpy as np

from haustra.errors import InvalidDesignError
from haustra.fields import number
from haustra.models.devices.base import Channel, Device, DeviceReadings, Handles, Pose, Reading, State, put
from haustra.models.devices.inchworm.driver import Gait, crawl
from haustra.models.devices.tether import tether_tension
from haustra.models.wall.planes import Sample

PADS = 6
"""Pads round each balloon."""
ENDS = "rear", "front"
_TETHER_RADIUS = 2e-3
"""As the tether is drawn [m]."""
_PAD_MASS = 1e-3
"""Mass of a pad [kg]; engineering choice: next to nothing."""
_PAD_DAMPING = 10.0
"""Damping of a pad's slide [N s/m]; engineering choice: filling and emptying take some tenths of a second."""
_SKIN = 60.0
"""Stiffness that draws a pad back [N/m]; engineering choice: an empty balloon is drawn in within half a second."""
_INSIDE = 0.03
"""How far inside the rear end begins [m]; engineering choice: beyond the anal canal's outer half."""
_SPEED_GAIN = 0.1
"""Within which the body's length follows what is asked for [s]; engineering choice."""
_SLIP = 1e-3
"""Speed below which the tether's drag fades, so that it holds and does not chatter [m/s]; engineering choice."""
_JOINT_RELAXATION = 0.2
"""Damping over stiffness of the joints [s]; engineering choice."""


@dataclass(frozen=True, kw_only=True)
class Inchworm(Device):
    """Numbers of a two-anchor inchworm, in SI units."""

    kind: ClassVar[str] = "inchworm"
    left_out: ClassVar[Mapping[str, str]] = {
        "balloon": "six pads for its whole side, each with one contact; they do not bulge between folds",
        "tether": "a drag at the rear end: its stiffness, and its pull on the wall in bends, are not modelled",
        "body between the balloons": "it touches the wall at the balloons and at its nose only",
    }

    diameter: float = number("m", 0.006, 0.03)
    """Diameter of the body and of an empty balloon [m]."""
    contracted: float = number("m", 0.01, 0.3)
    """Distance of the balloons' middles when contracted [m]."""
    stroke: float = number("m", 0.002, 0.3)
    """How much further apart they are when extended [m]."""
    balloon_length: float = number("m", 0.005, 0.1)
    """Length of a balloon's side that lies on the wall [m]."""
    balloon_diameter: float = number("m", 0.01, 0.1)
    """Largest diameter of a balloon [m]."""
    pressure: float = number("Pa", 100.0, 5e4)
    """Gauge pressure of a filled balloon [Pa]."""
    grip: float = number("1", 0.0, 2.0)
    """Coulomb's coefficient between balloons and wall [1]."""
    push: float = number("N", 0.1, 100.0)
    """Largest force with which the body extends and contracts [N]."""
    speed: float = number("m/s", 1e-4, 0.2)
    """Speed at which it extends and contracts [m/s]."""
    filling_time: float = number("s", 0.05, 20.0)
    """Time that its driver gives a balloon to fill or to empty [s]."""
    joint_stiffness: float = number("N m/rad", 1e-4, 10.0)
    """Stiffness of the joint before each balloon, about any axis across the body [N m/rad]."""
    steering_torque: float = number("N m", 0.0, 2.0)
    """Largest torque that turns the front balloon towards the lumen [N m]."""
    largest_bend_deg: float = number("degrees", 1.0, 120.0)
    """Largest bend of each joint [degrees]."""
    mass: float = number("kg", 1e-3, 0.5)
    """Mass of the body, without its tether [kg]."""
    drag: float = number("N s/m", 0.1, 200.0)
    """Drag of the lumen's mucus on each half of the body: force over speed [N s/m]."""
    turning_drag: float = number("N m s/rad", 1e-5, 0.1)
    """Drag of the mucus on turning: torque over turning rate [N m s/rad]."""
    tether_mass_per_length: float = number("kg/m", 0.0, 0.2)
    """Mass per length of the tether [kg/m]."""
    tether_friction: float = number("1", 0.0, 2.0)
    """Coulomb's coefficient between tether and wall [1]."""
    tether_held: float = number("N", 0.0, 5.0)
    """Tension with which the tether is paid out outside the patient [N]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.balloon_diameter <= self.diameter:
            raise InvalidDesignError(
                f"Device '{self.name}': balloon_diameter is {self.balloon_diameter} m; give more than the diameter, "
                f"{self.diameter} m."
            )
        if self.contracted < self.balloon_length:
            raise InvalidDesignError(
                f"Device '{self.name}': contracted is {self.contracted} m; give at least balloon_length, "
                f"{self.balloon_length} m."
            )

    @property
    def pad_area(self) -> float:
        """Share of a filled balloon's side that a pad stands for [m^2]."""
        return math.pi * self.balloon_diameter * self.balloon_length / PADS

    @property
    def gait(self) -> Gait:
        """Times of its cycle."""
        return Gait(self.filling_time, self.stroke / self.speed)

    @property
    def controls(self) -> tuple[Channel, ...]:
        """Pressures of both balloons, length of the body beyond the contracted one, and torques that steer."""
        torque = self.steering_torque
        return (
            *(Channel(f"pressure_{end}", "Pa", 0.0, self.pressure, self._name(f"balloon_{end}_0")) for end in ENDS),
            Channel("extension", "m", 0.0, self.stroke, self._name("extend")),
            *(Channel(f"steer_{axis}", "N m", -torque, torque, self._name(f"steer_{axis}")) for axis in "xy"),
        )

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What balloons, body and tether do."""
        return (
            *(Reading(f"balloon_{end}", "Pa", f"pressure of the {end} balloon") for end in ENDS),
            *(Reading(f"balloon_{end}_width", "m", f"mean diameter of the {end} balloon") for end in ENDS),
            Reading("body_pressure", "Pa", "the larger of both pressures, which presses on the wall"),
            Reading("extended", "m", "length of the body beyond the contracted one"),
            Reading("body_force", "N", "force with which it extends"),
            Reading("tether_drag", "N", "what the tether pulls back with"),
        )

    @property
    def usual(self) -> Mapping[str, Any]:
        """Both balloons begin inside."""
        return {"start_depth": self.contracted + 2 * (self._nose + self._ball) + _INSIDE}

    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """Two balloons, contracted; the nose `start` past the anus."""
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose.frame, float).ravel())
        nose = self._nose + self._ball
        behind = start - nose - self.contracted
        rear = spec.worldbody.add_body(
            name=self._name("rear"), pos=pose.position + behind * pose.frame[:, 2], quat=quaternion
        )
        # MuJoCo's contacts see inertia and not the drag: an armature of that order lets what is pressed come to rest.
        for axis, name in zip(np.eye(3), "xyz", strict=True):
            slide = {"type": mujoco.mjtJoint.mjJNT_SLIDE, "axis": axis, "armature": self.drag * timestep}
            rear.add_joint(name=self._name(f"slide_{name}"), damping=[self.drag, 0, 0], **slide)
        ball = {"type": mujoco.mjtJoint.mjJNT_BALL, "armature": self.turning_drag * timestep}
        rear.add_joint(name=self._name("ball"), damping=[self.turning_drag, 0, 0], **ball)
        samples = self._add_balloon(spec, rear, "rear", timestep)
        middle = rear.add_body(name=self._name("middle"), pos=[0, 0, self.balloon_length / 2])
        self._add_bend(middle, "rear", timestep)
        reach = self.contracted - self.balloon_length
        self._add_shell(middle, "middle", max(reach, 1e-4), [0.55, 0.6, 0.65, 1])
        slider = middle.add_body(name=self._name("slider"), pos=[0, 0, reach])
        slider.add_joint(
            name=self._name("extend"),
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[0, 0, 1],
            limited=True,
            range=[-0.002, self.stroke + 0.002],
            armature=self.drag * timestep,
            damping=[self.drag, 0, 0],
        )
        slider.add_geom(
            name=self._name("rod"),
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            fromto=[0, 0, -self.stroke, 0, 0, 0.5 * self.balloon_length],
            size=[0.25 * self.diameter, 0, 0],
            mass=1e-3,
            contype=0,
            conaffinity=0,
            rgba=[0.72, 0.74, 0.78, 1],
        )
        front = slider.add_body(name=self._name("front"), pos=[0, 0, self.balloon_length / 2])
        self._add_bend(front, "front", timestep, at=-self.balloon_length / 2)
        samples += self._add_balloon(spec, front, "front", timestep)
        samples += (Sample(self._name("front"), np.array([0, 0, self._nose]), self._ball),)
        front.add_site(name=self._name("tip"), pos=[0, 0, nose])
        front.add_geom(
            name=self._name("lens"),
            pos=[0, 0, nose],
            size=[0.2 * self.diameter, 0, 0],
            mass=0.0,
            contype=0,
            conaffinity=0,
            rgba=[0.1, 0.12, 0.2, 1],
        )
        rear.add_site(name=self._name("rear_end"), pos=[0, 0, -nose])
        self._add_actuators(spec)
        bodies = tuple(dict.fromkeys(sample.body for sample in samples))
        patch = math.sqrt(4 * self.pad_area / math.pi)
        patches = {body: patch for body in bodies if body != self._name("front")}
        trail = self._name("rear_end"), _TETHER_RADIUS
        return Handles(bodies, samples, (), self._name("tip"), start, trail, patches)

    def control(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Any:
        """Pressures on all pads, the body's length, steering, and the tether's drag over the speed of the rear end."""
        controls = super().control(xp, model, handles, state, commands)
        for end in ENDS:
            columns = [model.actuator(self._name(f"balloon_{end}_{pad}")).id for pad in range(PADS)]
            same = xp.stack([controls[:, columns[0]]] * PADS, axis=1)
            controls = put(xp, controls, columns, same)
        dofs = [int(model.joint(self._name(f"slide_{axis}")).dofadr[0]) for axis in "xyz"]
        speed = xp.sqrt((state.qvel[:, dofs] ** 2).sum(axis=1))
        damper = self._tether(xp, state) / xp.maximum(speed, _SLIP)
        return put(xp, controls, [model.actuator(self._name("tether")).id], damper[:, None])

    def read(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State) -> dict[str, Any]:
        """Each of `readings`, (worlds,)."""
        found: dict[str, Any] = {}
        for end in ENDS:
            names = [self._name(f"balloon_{end}_{pad}") for pad in range(PADS)]
            force = state.actuator_force[:, [model.actuator(name).id for name in names]]
            out = state.qpos[:, [int(model.joint(name).qposadr[0]) for name in names]]
            found[f"balloon_{end}"] = force.mean(axis=1) / self.pad_area
            found[f"balloon_{end}_width"] = self.diameter + 2 * out.mean(axis=1)
        body = model.actuator(self._name("extend")).id
        return found | {
            "body_pressure": xp.maximum(found["balloon_rear"], found["balloon_front"]),
            "extended": state.qpos[:, int(model.joint(self._name("extend")).qposadr[0])],
            "body_force": state.actuator_force[:, body],
            "tether_drag": xp.abs(state.actuator_force[:, model.actuator(self._name("tether")).id]),
        }

    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """Crawl by a gait of fixed times, the front turned towards the lumen ahead."""
        limits = self.pressure, self.stroke, self.steering_torque
        return crawl(xp, seen, self.gait, limits=limits, stiffness=self.joint_stiffness), memory

    @property
    def _ball(self) -> float:
        """Radius of a pad's sphere, which is drawn in to the axis, and of the nose [m]."""
        return self.diameter / 2

    @property
    def _nose(self) -> float:
        """From the front balloon's middle to the nose's [m]."""
        return max(self.balloon_length / 2 - self._ball, 0.0)

    def _add_balloon(self, spec: mujoco.MjSpec, body: Any, end: str, timestep: float) -> tuple[Sample, ...]:
        self._add_shell(body, end, self.balloon_length, [0.85, 0.87, 0.9, 1])
        most = (self.balloon_diameter - self.diameter) / 2
        samples = []
        for pad in range(PADS):
            name, angle = self._name(f"balloon_{end}_{pad}"), math.tau * pad / PADS
            out = np.array([math.cos(angle), math.sin(angle), 0.0])
            part = body.add_body(name=name, pos=[0, 0, 0])
            part.add_joint(
                name=name,
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=out,
                limited=True,
                range=[0.0, most],
                stiffness=[_SKIN, 0, 0],
                damping=[_PAD_DAMPING, 0, 0],
                armature=_PAD_DAMPING * timestep,
            )
            part.add_geom(  # a lobe of the balloon, wider and longer than the sphere that meets the wall
                name=name,
                type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
                size=[self._ball, 1.6 * self._ball, 0.6 * self.balloon_length],
                quat=[math.cos(angle / 2), 0, 0, math.sin(angle / 2)],
                mass=_PAD_MASS,
                contype=0,
                conaffinity=0,
                rgba=[0.95, 0.7, 0.35, 1],
            )
            actuator = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
            actuator.gainprm = [self.pad_area] + [0.0] * 9
            samples.append(Sample(name, np.zeros(3), self._ball, friction=self.grip))
        return tuple(samples)

    def _add_shell(self, body: Any, part: str, length: float, colour: list[float]) -> None:
        ends = [0, 0, -length / 2, 0, 0, length / 2] if part in ENDS else [0, 0, 0, 0, 0, length]
        body.add_geom(
            name=self._name(f"shell_{part}"),
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            fromto=ends,
            size=[self.diameter / 2 * (1.0 if part in ENDS else 0.7), 0, 0],
            mass=self.mass / 3,
            contype=0,
            conaffinity=0,
            rgba=colour,
        )

    def _add_bend(self, body: Any, end: str, timestep: float, *, at: float = 0.0) -> None:
        """Two hinges across the body, that the bend between a balloon and what follows is spread over."""
        damping, most = self.joint_stiffness * (_JOINT_RELAXATION + timestep), math.radians(self.largest_bend_deg)
        for axis, name in zip(np.eye(3), "xy", strict=False):
            body.add_joint(
                name=self._name(f"bend_{end}_{name}"),
                axis=axis,
                pos=[0, 0, at],
                stiffness=[self.joint_stiffness, 0, 0],
                damping=[damping, 0, 0],
                armature=damping * timestep,
                limited=True,
                range=[-most, most],
            )

    def _add_actuators(self, spec: mujoco.MjSpec) -> None:
        joint, site = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_SITE
        stiffness = self.push / (self.speed * _SPEED_GAIN)
        spec.add_actuator(
            name=self._name("extend"),
            trntype=joint,
            target=self._name("extend"),
            gainprm=[stiffness] + [0.0] * 9,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[0.0, -stiffness, -stiffness * _SPEED_GAIN / 5] + [0.0] * 7,
            forcelimited=True,
            forcerange=[-self.push, self.push],
        )
        for axis in "xy":
            spec.add_actuator(name=self._name(f"steer_{axis}"), trntype=joint, target=self._name(f"bend_front_{axis}"))
        # A damper along the axis at the rear end whose coefficient is the control: MuJoCo is implicit in it.
        spec.add_actuator(
            name=self._name("tether"),
            trntype=site,
            target=self._name("rear_end"),
            gear=[0, 0, 1, 0, 0, 0],
            gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
            gainprm=[0, 0, -1] + [0] * 7,
        )

    def _tether(self, xp: ModuleType, state: State) -> Any:
        return tether_tension(
            xp,
            state.bends,
            state.tip_arc,
            friction=self.tether_friction,
            mass_per_length=self.tether_mass_per_length,
            held=self.tether_held,
        )

    def _name(self, part: str) -> str:
        return f"{self.kind}/{part}"


DEVICE = Inchworm
