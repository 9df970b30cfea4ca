"""What an engineer decides about a colonoscope. SI units."""

import math
from dataclasses import dataclass, fields

from haustra.errors import InvalidDesignError


@dataclass(frozen=True)
class ScopeSection:
    """A stretch of the insertion tube with uniform stiffness."""

    length: float
    """Length [m]."""
    flexural_rigidity: float
    """Bending stiffness EI [N m^2]."""
    torsional_rigidity: float
    """Torsional stiffness GJ [N m^2]; independent of EI, about 13 times it on real scopes."""


@dataclass(frozen=True)
class TendonSet:
    """Four pull wires of the bending section, 90 degrees apart."""

    routing_radius: float
    """Distance of each wire from the axis [m]."""
    pull_limit: float
    """Largest pull of one wire [N]."""


@dataclass(frozen=True)
class ScopeTip:
    """The rigid distal end with its camera."""

    length: float
    """Rigid length [m]."""
    field_of_view_deg: float
    """Full viewing angle of the camera [degrees]."""


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
    loss_time: float
    """Relaxation time of bending and twist: viscous torque per rate over elastic torque per angle [s]."""
    shaft: tuple[ScopeSection, ...]
    """From the handle to the bending section."""
    bending: ScopeSection
    """The section that the wires bend."""
    bending_limit_up_down_deg: float
    """Largest angle over the whole bending section, up and down [degrees]."""
    bending_limit_left_right_deg: float
    """Largest angle over the whole bending section, left and right [degrees]."""
    tendons: TendonSet
    tip: ScopeTip

    def __post_init__(self) -> None:
        for where, part in self._parts():
            _require_positive(where, part)
        if not self.shaft:
            raise InvalidDesignError(f"Scope '{self.name}' has no shaft section: give at least one.")
        if self.tendons.routing_radius >= self.diameter / 2:
            raise InvalidDesignError(
                f"Scope '{self.name}': tendons at {self.tendons.routing_radius * 1e3:.2f} mm from the axis lie outside "
                f"the body (radius {self.diameter * 5e2:.2f} mm): lower tendons.routing_radius."
            )
        largest = max(self.bending_limit_up_down_deg, self.bending_limit_left_right_deg)
        if self.bending.length / math.radians(largest) < self.diameter / 2:
            raise InvalidDesignError(
                f"Scope '{self.name}': {largest:.0f} degrees over {self.bending.length * 1e3:.0f} mm bend tighter than "
                f"its own radius: lower the bending limits or lengthen the bending section."
            )

    @property
    def length(self) -> float:
        """Working length: shaft, bending section and tip [m]."""
        return sum(section.length for section in self.shaft) + self.bending.length + self.tip.length

    def _parts(self):
        yield f"Scope '{self.name}'", self
        for index, section in enumerate(self.shaft):
            yield f"Scope '{self.name}', shaft section {index}", section
        yield f"Scope '{self.name}', bending section", self.bending
        yield f"Scope '{self.name}', tendons", self.tendons
        yield f"Scope '{self.name}', tip", self.tip


def _require_positive(where: str, part: object) -> None:
    for field in fields(part):  # type: ignore[arg-type]
        value = getattr(part, field.name)
        if isinstance(value, int | float) and not (math.isfinite(value) and value > 0):
            raise InvalidDesignError(f"{where}: {field.name} is {value}; it must be a positive number.")
