"""What an engineer decides about the tracked robot. SI units."""

from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any

import numpy as np

from haustra.errors import InvalidDesignError
from haustra.fields import Number, number, require_declared, shown, whole
from haustra.models.devices.tracked.tread import NUMBERS, TreadGeometry

TRACKS = 4
"""Tracks, 90 degrees apart."""
SCALE = Number("1", 0.05, 20.0)
"""Size over the device in practice."""

_MESHING_TOLERANCE = 0.01
"""Largest relative difference between the worm's lead and starts times pitch: beyond it teeth would climb the worm."""


@dataclass(frozen=True, kw_only=True)
class Worm:
    """The worm in the core that drives all four treads."""

    starts: int = whole(1, 16, default=2)
    """Number of the worm's threads. Assumed: lead / pitch."""
    lead: float = number("m", 1e-4, 0.2, default=NUMBERS["tracked.worm.lead"].value)
    """Length of track that one turn of the worm moves [m]. Published."""
    efficiency: float = number("1", 0.01, 1.0, default=NUMBERS["tracked.worm.efficiency"].value)
    """Efficiency of a self-locking polymer worm [1]. Assumed."""
    torque_limit: float = number("N m", 1e-6, 100.0, default=NUMBERS["tracked.worm.torque_limit"].value)
    """Largest torque that the flexible shaft may transmit [N m]. Assumed."""


@dataclass(frozen=True, kw_only=True)
class FlexibleShaft:
    """The shaft between the motor outside and the worm."""

    onset_speed: float = number("rad/s", 0.01, 1e4, default=NUMBERS["tracked.shaft.onset_speed"].value)
    """Speed at which the shaft's losses begin to rise [rad/s]. Published: "above this value the transmission efficiency
    declines"."""
    efficiency: float = number("1", 0.01, 1.0, default=NUMBERS["tracked.shaft.efficiency"].value)
    """Share of the drive that reaches the treads up to the onset [1]. Fitted: the paper's RMSE at the peak."""
    stall_excess: float = number("rad/s", 0.01, 1e5, default=NUMBERS["tracked.shaft.stall_excess"].value)
    """Excess over the onset at which viscous loss would take all of the drive [rad/s]. Fitted with
    `SpeedFriction.exponent`: the paper's statements identify only both together, and we let both ends of the range lose
    alike."""

    def transmission(self, speed: Any, *, xp: ModuleType = np) -> Any:
        """Share of the traction force that still reaches the treads at a worm speed [rad/s], or at several.

        A motor torque less a viscous loss: efficiency (1 - (w - w_onset) / w_stall), constant below the onset.
        """
        excess = xp.maximum(0.0, speed - self.onset_speed) / self.stall_excess
        return self.efficiency * xp.maximum(0.0, 1.0 - excess)


@dataclass(frozen=True, kw_only=True)
class Bellows:
    """One of the four bellows, through its strut, as a spring along the radius.

    Pressure narrows the device: outward force = preload + stiffness (q0 - q) - area x pressure, where q is how far the
    track is out from its nominal radius and q0 = 0.
    """

    stiffness: float = number("N/m", 0.01, 1e6, default=NUMBERS["tracked.bellows.stiffness"].value)
    """Radial stiffness of one bellows through its strut [N/m]. Assumed."""
    preload: float = number("N", 1e-4, 1e3, default=NUMBERS["tracked.bellows.preload"].value)
    """Outward force at the nominal diameter and atmospheric pressure [N]. Derived from the paper: 0.75 N / 0.4."""
    pressure: float = number("Pa", 0.0, 1e6, default=NUMBERS["tracked.bellows.pressure"].value)
    """Pressure in the bellows above that of the atmosphere [Pa]. Published: closed off at atmospheric pressure."""
    area: float = number("m^2", 1e-8, 0.1, default=NUMBERS["tracked.bellows.area"].value)
    """Effective area of the bellows over the strut's gearing [m^2]. Assumed."""
    lowest_pressure: float = number("Pa", -1e5, 0.0, default=NUMBERS["tracked.bellows.lowest_pressure"].value)
    """Lowest pressure that a regulator may set, below that of the atmosphere [Pa]. Assumed."""
    highest_pressure: float = number("Pa", 0.0, 1e6, default=NUMBERS["tracked.bellows.highest_pressure"].value)
    """Highest pressure that a regulator may set [Pa]. Assumed."""
    response: float = number("s", 0.0, 60.0, default=NUMBERS["tracked.bellows.response"].value)
    """Time within which the pressure in a bellows answers to its regulator [s]. Assumed: air through a thin line."""

    def force(self, extension: float) -> float:
        """Outward force at a radial extension from the nominal radius [N]."""
        return self.preload - self.stiffness * extension - self.area * self.pressure

    def regulated(self, extension: Any, press: Any, *, xp: ModuleType = np) -> Any:
        """Pressure that makes the outward force `press` [N] at an extension, as far as the limits let it [Pa]."""
        wanted = (self.preload - self.stiffness * extension - press) / self.area
        return xp.clip(wanted, self.lowest_pressure, self.highest_pressure)


@dataclass(frozen=True, kw_only=True)
class Tether:
    """What the device trails: the flexible shaft in its sheath, air lines, wires."""

    mass_per_length: float = number("kg/m", 0.0, 20.0, default=NUMBERS["tracked.tether.mass_per_length"].value)
    """Mass per length [kg/m]. Assumed."""
    friction: float = number("1", 0.0, 2.0, default=NUMBERS["tracked.tether.friction"].value)
    """Coulomb's coefficient between tether and wall [1]. Assumed."""
    held: float = number("N", 0.0, 100.0, default=NUMBERS["tracked.tether.held"].value)
    """Tension with which it is paid out outside the patient [N]. Assumed."""


@dataclass(frozen=True, kw_only=True)
class SpeedFriction:
    """Coulomb's coefficient against sliding speed, relative to its nominal value.

    (v / v_peak)^exponent below the peak: friction of wet soft tissue rises with speed (Lyle 2013, Tribol Lett 51:377).
    Constant above it, where the loss that the paper reports is the shaft's.
    """

    peak_speed: float = number("m/s", 1e-6, 10.0, default=NUMBERS["tracked.speed_friction.peak_speed"].value)
    """Sliding speed from which on friction no longer rises [m/s]. Published: the optimum, 150 rpm."""
    exponent: float = number("1", 0.0, 10.0, default=NUMBERS["tracked.speed_friction.exponent"].value)
    """Exponent of friction over sliding speed below the peak [1]. Fitted: the paper's mean and RMSE over the range."""

    def factor(self, speed: float) -> float:
        """Coefficient at a sliding speed [m/s] over its nominal value."""
        return min(1.0, max(0.0, speed) / self.peak_speed) ** self.exponent

    def sliding(self, share: Any, *, xp: ModuleType = np) -> Any:
        """Speed [m/s] at which friction is that share of its nominal value, or several: `factor` turned round.

        Friction that does not depend on the speed holds without sliding.
        """
        return self.peak_speed * xp.clip(share, 0.0, 1.0) ** (1 / self.exponent) if self.exponent else 0.0 * share


@dataclass(frozen=True, kw_only=True)
class TrackedDesign:
    """A robot with four treads on struts that bellows spread, driven by one worm over a flexible shaft.

    Defaults are the paper's 4:1 prototype; `at_scale(1.0)` is the device in practice, with the same stresses.

    Raises:
        InvalidDesignError: when a value is impossible or parts do not fit together.
    """

    name: str = "tracked prototype 4:1"
    """Name of the design, for people."""
    scale: float = number(SCALE.of, SCALE.low, SCALE.high, default=NUMBERS["tracked.device.scale"].value)
    """Size of the device over that in practice [1]. Published: 4."""
    tread: TreadGeometry = field(default_factory=TreadGeometry)
    worm: Worm = field(default_factory=Worm)
    shaft: FlexibleShaft = field(default_factory=FlexibleShaft)
    bellows: Bellows = field(default_factory=Bellows)
    tether: Tether = field(default_factory=Tether)
    speed_friction: SpeedFriction = field(default_factory=SpeedFriction)
    nominal_diameter: float = number("m", 0.001, 1.0, default=NUMBERS["tracked.device.nominal_diameter"].value)
    """Diameter from track to track at which the bellows press with their preload [m]. Published."""
    smallest_diameter: float = number("m", 0.001, 1.0, default=NUMBERS["tracked.device.smallest_diameter"].value)
    """Diameter from track to track when the device is folded [m]. Published."""
    largest_diameter: float = number("m", 0.001, 1.0, default=NUMBERS["tracked.device.largest_diameter"].value)
    """Diameter from track to track when the device is spread [m]. Published."""
    core_length: float = number("m", 0.001, 1.0, default=NUMBERS["tracked.device.core_length"].value)
    """Length of the core [m]. Assumed."""
    core_diameter: float = number("m", 0.001, 1.0, default=NUMBERS["tracked.device.core_diameter"].value)
    """Diameter of the core [m]. Assumed."""
    mass: float = number("kg", 1e-6, 100.0, default=NUMBERS["tracked.device.mass"].value)
    """Mass of the whole device [kg]. Assumed; weight is left out, as in the paper."""

    def __post_init__(self) -> None:
        require_declared(self, f"Tracked design {shown(self.name)}", error=InvalidDesignError)
        if not self.smallest_diameter <= self.nominal_diameter <= self.largest_diameter:
            raise InvalidDesignError(
                f"Tracked design '{self.name}': nominal diameter {self.nominal_diameter * 1e3:.1f} mm is outside "
                f"{self.smallest_diameter * 1e3:.1f}-{self.largest_diameter * 1e3:.1f} mm: correct one of the three."
            )
        if self.core_diameter >= self.smallest_diameter:
            raise InvalidDesignError(
                f"Tracked design '{self.name}': core of {self.core_diameter * 1e3:.1f} mm does not fit inside the "
                f"folded device of {self.smallest_diameter * 1e3:.1f} mm: thin the core."
            )
        if abs(self.worm.starts * self.tread.pitch / self.worm.lead - 1) > _MESHING_TOLERANCE:
            raise InvalidDesignError(
                f"Tracked design '{self.name}': a worm of {self.worm.starts} starts and {self.worm.lead * 1e3:g} mm "
                f"lead does not mesh with a pitch of {self.tread.pitch * 1e3:g} mm: the lead is starts times pitch."
            )

    @property
    def stroke(self) -> tuple[float, float]:
        """How far a track can move in and out from the nominal radius [m]: negative, positive."""
        half = self.nominal_diameter / 2
        return self.smallest_diameter / 2 - half, self.largest_diameter / 2 - half

    def at_scale(self, scale: float) -> "TrackedDesign":
        """Scale this device, materials unchanged: forces go with the square of length.

        Raises:
            InvalidDesignError: when the scale is out of its range.
        """
        if said := SCALE.wrong(scale):
            raise InvalidDesignError(f"at_scale{said}; 1 is the device in practice.")
        s = scale / self.scale
        tread = TreadGeometry(**{name: value * s for name, value in self.tread.to_json().items()})
        return replace(
            self,
            name=f"{self.name}, scaled to {scale:g}:1",
            scale=scale,
            tread=tread,
            worm=replace(self.worm, lead=self.worm.lead * s, torque_limit=self.worm.torque_limit * s**3),
            bellows=replace(
                self.bellows,
                stiffness=self.bellows.stiffness * s,
                preload=self.bellows.preload * s**2,
                area=self.bellows.area * s**2,
            ),
            tether=replace(
                self.tether, mass_per_length=self.tether.mass_per_length * s**2, held=self.tether.held * s**2
            ),
            speed_friction=replace(self.speed_friction, peak_speed=self.speed_friction.peak_speed * s),
            nominal_diameter=self.nominal_diameter * s,
            smallest_diameter=self.smallest_diameter * s,
            largest_diameter=self.largest_diameter * s,
            core_length=self.core_length * s,
            core_diameter=self.core_diameter * s,
            mass=self.mass * s**3,
        )

    def extension_in(self, lumen_diameter: float) -> float:
        """How far the tracks stand out from the nominal radius in a lumen [m]; folded further than rest if negative.

        Raises:
            InvalidDesignError: when the lumen is smaller than the folded device or wider than its reach.
        """
        if not lumen_diameter >= self.smallest_diameter:
            raise InvalidDesignError(
                f"A lumen of {lumen_diameter * 1e3:.1f} mm is smaller than the folded device of "
                f"{self.smallest_diameter * 1e3:.1f} mm: scale the design down or choose a wider place."
            )
        if lumen_diameter > self.largest_diameter:
            raise InvalidDesignError(
                f"A lumen of {lumen_diameter * 1e3:.1f} mm is out of the tracks' reach of "
                f"{self.largest_diameter * 1e3:.1f} mm: scale the design up or choose a narrower place."
            )
        return (lumen_diameter - self.nominal_diameter) / 2

    def tread_speed(self, worm_rpm: float) -> float:
        """Speed of the treads relative to the core [m/s] at a worm speed in turns a minute."""
        return self.worm.lead * worm_rpm / 60

    def phase_offsets(self) -> tuple[float, ...]:
        """Tooth phase of each track against the first, in pitches: starts x azimuth / 360 degrees."""
        return tuple(self.worm.starts * track / TRACKS % 1.0 for track in range(TRACKS))
