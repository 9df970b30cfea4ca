"""An everting ("vine") endoscope: pressure turns its tail inside out at the tip, where new body appears.

What lies on the wall was laid there and does not slide. At any instant it is an elastic curve from the anus to the
tip, of a length that grows, held at the anus: the same curve as that of a shaft which is pushed in without friction,
which is how it is simulated, by the chain of a scope (`haustra.models.devices.scope.cable`). The force along it is what
the tip presses with. Pressure p on the cross-section A has that force left over from what eversion takes,

    F = (p - p_y) A - T,

where p_y turns the material and T is the tail's tension at the tip, drawn through the body and round its bends
(`haustra.models.devices.tether`), as in the model of Blumenschein, Okamura and Hawkes (2017, doi
10.1007/978-3-319-63537-8_44). Growth is as fast as the tail is paid out, and stops where F is used up.

Its bending stiffness is that of a wrinkled inflated tube, which gives way at the moment pi p r^3 (Comer and Levy 1963,
doi 10.2514/3.1873): over the radius R of a usual bend it acts as EI = pi p r^3 R.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import Any, ClassVar

import mujoco
import numpy as np

from haustra.fields import number
from haustra.models.devices.base import Channel, Device, DeviceReadings, Handles, Pose, Reading, State, put
from haustra.models.devices.scope.design import BendingLimits, ScopeDesign, ScopeSection, ScopeTip
from haustra.models.devices.scope.interface import Scope
from haustra.models.devices.scope.wires import WIRE_NAMES, WireSet
from haustra.models.devices.tether import tether_tension
from haustra.models.devices.vine.driver import drive
from haustra.models.devices.vine.looks import FILM, draw_tip

_ANSWER = 0.1
"""Within which growth stops when the pressure is used up [s]; engineering choice: five control intervals."""
_HAND_STIFFNESS = 4000.0
"""Stiffness of what holds the body at the anus [N/m]: a hand's on a scope."""
_GJ_OVER_EI = 0.77
"""Ratio of a tube of one isotropic material, 1 / (1 + nu) with nu = 0.3 [1]."""
_RELAXATION_TIME = 0.1
"""Viscous over elastic torque of its wall [s]; engineering choice."""
_ROUTING = 0.9
"""Where what steers the tip pulls, over the radius [1]; engineering choice: along its skin."""
_CELL = 0.025
"""Largest distance between joints of the body [m]; engineering choice: as finely as the scope's shaft in linear time.
Over the first 10 s in a moving colon 99 % of peak forces were below 2.7 N at 40 mm, 1.8 N at 25 and 1.5 N at 10."""
_LONGEST_STEP = 0.0025
"""Time step that suits so light a body [s]; engineering choice. At 5 ms its links chatter on the wall and press several
times as hard; half of it changes the largest force by less than 3 % in grown colons."""


@dataclass(frozen=True, kw_only=True)
class Vine(Device):
    """Numbers of an everting endoscope, in SI units."""

    kind: ClassVar[str] = "vine"
    is_shaft: ClassVar[bool] = True
    left_out: ClassVar[Mapping[str, str]] = {
        "friction of what was laid": "it does not slide, and is taken not to hold on either: nothing but its own "
        "stiffness and the wall's normal force keep it where it lies",
        "buckling of the inflated tube": "its stiffness is that of a tube that has wrinkled in bends of a usual radius",
        "retraction": "drawn back it follows its path outside in; that a free tube would rather coil is not modelled",
    }

    length: float = number("m", 0.1, 5.0)
    """Length of body that can evert [m]."""
    diameter: float = number("m", 0.004, 0.04)
    """Diameter of the inflated body [m]."""
    mass_per_length: float = number("kg/m", 0.001, 1.0)
    """Mass per length of body and tail [kg/m]."""
    pressure: float = number("Pa", 100.0, 2e5)
    """Largest gauge pressure inside [Pa]."""
    eversion_pressure: float = number("Pa", 0.0, 1e5)
    """Pressure that it takes to turn the material inside out at the tip [Pa]."""
    bend_radius: float = number("m", 0.005, 1.0)
    """Radius of bends whose moment its bending stiffness stands for [m]."""
    tail_friction: float = number("1", 0.0, 2.0)
    """Coulomb's coefficient between tail and body [1]."""
    tail_mass_per_length: float = number("kg/m", 0.0, 0.5)
    """Mass per length of the tail and what it carries [kg/m]."""
    tail_held: float = number("N", 0.0, 20.0)
    """Tension with which the tail is paid out at the anus [N]."""
    growth_rate: float = number("m/s", 1e-4, 0.2)
    """Speed at which its driver pays the tail out [m/s]."""
    steering_length: float = number("m", 0.02, 0.3)
    """Length behind the tip that is steered [m]."""
    steering_deg: float = number("degrees", 1.0, 270.0)
    """Largest bend of that stretch [degrees]."""
    field_of_view_deg: float = number("degrees", 1.0, 360.0, default=120.0)
    """Full viewing angle of the camera at its tip [degrees]."""
    safe_force: float = number("N", 0.05, 50.0)
    """Wall force beyond which the driver stops and backs off [N]."""

    @property
    def area(self) -> float:
        """Cross-section that the pressure acts on [m^2]."""
        return math.pi * self.diameter**2 / 4

    @property
    def flexural_rigidity(self) -> float:
        """Collapse moment of the inflated tube times the radius of a usual bend [N m^2]."""
        return math.pi * self.pressure * (self.diameter / 2) ** 3 * self.bend_radius

    @property
    def view_deg(self) -> float:
        """The field of its design."""
        return self.field_of_view_deg

    @property
    def usual(self) -> Mapping[str, Any]:
        """A time step of its own."""
        return {"timestep": _LONGEST_STEP}

    @property
    def controls(self) -> tuple[Channel, ...]:
        """Growth, pressure, and the bend of the steered stretch about two axes."""
        most = math.radians(self.steering_deg)
        return (
            Channel("growth_rate", "m/s", -self.growth_rate, self.growth_rate, "scope/push"),
            Channel("pressure", "Pa", 0.0, self.pressure, "vine/pressure"),
            Channel("bend_up", "rad", -most, most, "scope/pull_up"),
            Channel("bend_left", "rad", -most, most, "scope/pull_left"),
        )

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What growth takes."""
        return (
            Reading("grown", "m", "body past the anus"),
            Reading("tip_press", "N", "force along the body, which the tip presses with"),
            Reading("available", "N", "what the pressure has left for it"),
            Reading("tail_tension", "N", "tension of the tail at the tip"),
            Reading("body_pressure", "Pa", "pressure inside"),
        )

    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """A straight body, its tip past the anus; nothing of it slides on the wall."""
        handles = self.body.add_to(spec, pose, timestep=timestep, start=start)
        # Without a force: its control says what the pressure is.
        inside = spec.add_actuator(name="vine/pressure", target="scope/push", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        inside.gainprm = [0.0] * 10
        for name in handles.geoms:
            spec.geom(name).rgba = FILM
        draw_tip(spec, handles.tip, self.diameter / 2)
        samples = tuple(replace(sample, friction=0.0) for sample in handles.samples)
        return replace(handles, samples=samples)

    def control(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Any:
        """Growth as asked for, as far as the pressure goes, and pulls that bend the steered stretch."""
        channels = self.controls
        low, high = (np.array([getattr(one, side) for one in channels]) for side in ("low", "high"))
        rate, pressure, up, left = xp.clip(commands, low, high).T
        spare = self._left_over(xp, pressure, state) - self._pressing(model, state)
        grows = state.qvel[:, int(model.joint("scope/push").dofadr[0])]
        rate = xp.minimum(rate, xp.maximum(grows + spare / (_HAND_STIFFNESS * _ANSWER), 0.0))
        bends = xp.stack([up, left], axis=1) * self.body.design.pull_per_angle
        pulls = xp.maximum(xp.concatenate([bends, -bends], axis=1), 0.0)
        asked = xp.concatenate([rate[:, None], 0.0 * rate[:, None], pulls], axis=1)
        controls = self.body.control(xp, model, handles, state, asked)
        return put(xp, controls, [model.actuator("vine/pressure").id], pressure[:, None])

    def read(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State) -> dict[str, Any]:
        """Each of `readings`, (worlds,)."""
        full = self.pressure + xp.zeros_like(state.tip_arc)
        return {
            "grown": self.body.read(xp, model, handles, state)["insertion"],
            "tip_press": self._pressing(model, state),
            "available": self._left_over(xp, full, state),
            "tail_tension": self._tail(xp, state),
            "body_pressure": full,
        }

    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """Grow at full pressure, the tip bent towards the lumen ahead; back off while the wall presses too hard."""
        limits = self.growth_rate, self.pressure, math.radians(self.steering_deg)
        return drive(xp, seen, memory, limits=limits, safe_force=self.safe_force)

    @cached_property
    def body(self) -> Scope:
        """The chain of a scope that stands for it."""
        rigidity, radius = self.flexural_rigidity, self.diameter / 2
        part = {"flexural_rigidity": rigidity, "torsional_rigidity": _GJ_OVER_EI * rigidity}
        tip = radius
        design = ScopeDesign(
            name=self.name,
            diameter=self.diameter,
            mass_per_length=self.mass_per_length,
            relaxation_time=_RELAXATION_TIME,
            shaft=(ScopeSection(length=self.length - self.steering_length - tip, **part),),
            bending=ScopeSection(length=self.steering_length, **part),
            limits=BendingLimits(**dict.fromkeys(WIRE_NAMES, self.steering_deg)),
            wires=WireSet(routing_radius=_ROUTING * radius, pull_limit=100.0),
            tip=ScopeTip(length=tip, field_of_view_deg=self.field_of_view_deg),
        )
        return Scope(name=self.name, design=design, shaft_cell=_CELL)

    def _pressing(self, model: mujoco.MjModel, state: State) -> Any:
        """Force along the body (worlds,) [N]."""
        return state.actuator_force[:, model.actuator("scope/push").id]

    def _left_over(self, xp: ModuleType, pressure: Any, state: State) -> Any:
        """What a pressure [Pa] has left for the tip (worlds,) [N]; less than none where it cannot evert."""
        return (pressure - self.eversion_pressure) * self.area - self._tail(xp, state)

    def _tail(self, xp: ModuleType, state: State) -> Any:
        return tether_tension(
            xp,
            state.bends,
            state.tip_arc,
            friction=self.tail_friction,
            mass_per_length=self.tail_mass_per_length,
            held=self.tail_held,
        )


DEVICE = Vine
