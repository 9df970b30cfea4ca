"""What an engineer decides about a colonoscope. SI units; angles in degrees where a person reads them."""

import math
from dataclasses import dataclass, field, fields

from haustra.errors import InvalidDesignError
from haustra.models.devices.scope.wires import WireSet

_ALLOWED_ZERO = frozenset(
    {"bias_up_deg", "bias_left_deg", "variable_stiffness", "friction", "slack", "compliance", "hysteresis"}
    | {"camera_offset_up", "camera_offset_left", "camera_tilt_deg", "light"}
)
"""Fields for which zero means 'none of it'."""

_ALLOWED_NEGATIVE = frozenset(
    {"bias_up_deg", "bias_left_deg", "camera_offset_up", "camera_offset_left", "camera_tilt_deg"}
)


@dataclass(frozen=True)
class ScopeSection:
    """A stretch of the insertion tube with uniform stiffness."""

    length: float
    """Length [m]."""
    flexural_rigidity: float
    """Bending stiffness EI at the softest setting and room temperature [N m^2]."""
    torsional_rigidity: float
    """Torsional stiffness GJ at room temperature [N m^2]; independent of EI, about 13 times it on real scopes."""
    stiffening: float = 1.0
    """EI at the stiffest setting over EI at the softest [1]; 1 where the setting has no effect."""
    minimum_bend_radius: float | None = None
    """The section cannot bend tighter than this [m]; None for no stop."""
    bias_up_deg: float = 0.0
    """Angle that the unloaded section bends through towards wire 'up' [degrees]: a pre-curved scope."""
    bias_left_deg: float = 0.0
    """The same towards wire 'left' [degrees]."""


@dataclass(frozen=True)
class BendingLimits:
    """Largest angle over the whole bending section in each direction [degrees]."""

    up: float
    left: float
    down: float
    right: float

    @property
    def largest(self) -> float:
        """Of the four [degrees]."""
        return max(self.up, self.left, self.down, self.right)

    @property
    def smallest(self) -> float:
        """Of the four [degrees]."""
        return min(self.up, self.left, self.down, self.right)


@dataclass(frozen=True)
class ScopeTip:
    """The rigid distal end with its camera and light."""

    length: float
    """Rigid length [m]."""
    field_of_view_deg: float
    """Full viewing angle of the camera [degrees]."""
    camera_offset_up: float = 0.0
    """Distance of the camera from the axis, towards wire 'up' [m]."""
    camera_offset_left: float = 0.0
    """Distance of the camera from the axis, towards wire 'left' [m]."""
    camera_tilt_deg: float = 0.0
    """Angle of the view from the axis, towards wire 'up' [degrees]."""
    light: float = 1.0
    """Brightness of the light, relative to the renderer's default [1]."""


@dataclass(frozen=True)
class ScopeDesign:
    """A colonoscope: insertion tube, bending section, pull wires and tip.

    Raises:
        InvalidDesignError: when a value is not positive and finite, or parts do not fit together.
    """

    name: str
    """What a person calls it."""
    diameter: float
    """Outer diameter, the same along the scope [m]."""
    mass_per_length: float
    """Mass per length [kg/m]."""
    relaxation_time: float
    """Relaxation time of bending and twist: viscous torque per rate over elastic torque per angle [s]."""
    shaft: tuple[ScopeSection, ...]
    """From the handle to the bending section."""
    bending: ScopeSection
    """The section that the wires bend."""
    limits: BendingLimits
    wires: WireSet
    tip: ScopeTip
    temperature_factor_bending: float = 1.0
    """EI in use over EI as given [1]; 1 at room temperature, about 0.83 inside the body."""
    temperature_factor_torsion: float = 1.0
    """GJ in use over GJ as given [1]; 1 at room temperature, about 0.93 inside the body."""
    variable_stiffness: float = 0.0
    """Setting of the stiffening ring, from 0 (soft) to 1 (stiff)."""
    working_length: float | None = field(default=None)
    """What the parts should add up to [m]; checked when given."""

    def __post_init__(self) -> None:
        for where, part in self._parts():
            _require_numbers(where, part)
        self._require_fit()

    @property
    def length(self) -> float:
        """Working length: shaft, bending section and tip [m]."""
        return sum(section.length for section in self.shaft) + self.bending.length + self.tip.length

    def flexural_rigidity(self, section: ScopeSection) -> float:
        """EI of a section in use: at this design's temperature and stiffness setting [N m^2]."""
        setting = 1 + self.variable_stiffness * (section.stiffening - 1)
        return section.flexural_rigidity * setting * self.temperature_factor_bending

    @property
    def pull_per_angle(self) -> float:
        """Pull that bends the free bending section by an angle [N/rad]: constant curvature, angle = F r L / EI."""
        return self.flexural_rigidity(self.bending) / (self.wires.routing_radius * self.bending.length)

    def torsional_stiffness(self, section: ScopeSection) -> float:
        """GJ of a section in use [N m^2]."""
        return section.torsional_rigidity * self.temperature_factor_torsion

    def _parts(self):
        yield f"Scope '{self.name}'", self
        for index, section in enumerate(self.shaft):
            yield f"Scope '{self.name}', shaft section {index}", section
        yield f"Scope '{self.name}', bending section", self.bending
        yield f"Scope '{self.name}', limits", self.limits
        yield f"Scope '{self.name}', wires", self.wires
        yield f"Scope '{self.name}', tip", self.tip

    def _require_fit(self) -> None:
        where = f"Scope '{self.name}'"
        radius = self.diameter / 2
        if not self.shaft:
            raise InvalidDesignError(f"{where} has no shaft section: give at least one.")
        if self.wires.routing_radius >= radius:
            raise InvalidDesignError(
                f"{where}: wires at {self.wires.routing_radius * 1e3:.2f} mm from the axis lie outside the body "
                f"(radius {radius * 1e3:.2f} mm): lower wires.routing_radius."
            )
        if self.bending.length / math.radians(self.limits.largest) < radius:
            raise InvalidDesignError(
                f"{where}: {self.limits.largest:.0f} degrees over {self.bending.length * 1e3:.0f} mm bend tighter than "
                f"its own radius: lower the bending limits or lengthen the bending section."
            )
        if math.hypot(self.tip.camera_offset_up, self.tip.camera_offset_left) >= radius:
            raise InvalidDesignError(f"{where}: the camera lies outside the tip: lower its offset.")
        if self.variable_stiffness > 1:
            raise InvalidDesignError(f"{where}: variable_stiffness is {self.variable_stiffness}; give 0 to 1.")
        if self.wires.hysteresis >= 1:
            raise InvalidDesignError(f"{where}: wires.hysteresis is {self.wires.hysteresis}; give less than 1.")
        self._require_bias_within_limits(where)
        if not self.tip.field_of_view_deg <= 360:
            raise InvalidDesignError(f"{where}: field_of_view_deg is {self.tip.field_of_view_deg}; give at most 360.")
        if self.working_length is not None and not math.isclose(self.working_length, self.length, abs_tol=1e-4):
            raise InvalidDesignError(
                f"{where}: sections and tip add up to {self.length:.4f} m, not to its working length of "
                f"{self.working_length:.4f} m: correct one of them."
            )
        for section in (*self.shaft, self.bending):
            if section.minimum_bend_radius is not None and section.minimum_bend_radius < radius:
                raise InvalidDesignError(f"{where}: a minimum_bend_radius is smaller than the scope's own radius.")

    def _require_bias_within_limits(self, where: str) -> None:
        bending, limits = self.bending, self.limits
        reach = (
            (bending.bias_up_deg, limits.up, limits.down),
            (bending.bias_left_deg, limits.left, limits.right),
        )
        if any(not -back < bias < ahead for bias, ahead, back in reach):
            raise InvalidDesignError(
                f"{where}: the bending section is pre-curved beyond its own limits: lower its bias or raise the limits."
            )
        for section in self.shaft:
            bias = math.radians(math.hypot(section.bias_up_deg, section.bias_left_deg))
            if bias * max(section.minimum_bend_radius or 0.0, self.diameter / 2) > section.length:
                raise InvalidDesignError(
                    f"{where}: a shaft section is pre-curved tighter than it may bend: lower its bias."
                )


def _require_numbers(where: str, part: object) -> None:
    for entry in fields(part):  # type: ignore[arg-type]
        value = getattr(part, entry.name)
        if not isinstance(value, int | float):
            continue
        lowest = "any" if entry.name in _ALLOWED_NEGATIVE else "zero" if entry.name in _ALLOWED_ZERO else "positive"
        fine = math.isfinite(value) and {"any": True, "zero": value >= 0, "positive": value > 0}[lowest]
        if not fine:
            kind = {"any": "finite", "zero": "zero or positive", "positive": "positive"}[lowest]
            raise InvalidDesignError(f"{where}: {entry.name} is {value}; it must be a {kind} number.")
