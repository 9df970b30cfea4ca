"""What an engineer decides about a colonoscope. SI units; angles in degrees where a person reads them."""

import math
from dataclasses import dataclass

from haustra.errors import InvalidDesignError
from haustra.fields import choice, number, require_declared, shown
from haustra.models.devices.scope.wires import WireSet


@dataclass(frozen=True)
class ScopeSection:
    """A stretch of the insertion tube with uniform stiffness."""

    length: float = number("m", 0.002, 10.0)
    """Length of the section [m]."""
    flexural_rigidity: float = number("N m^2", 1e-6, 1e3)
    """Bending stiffness EI at the softest setting and room temperature [N m^2]."""
    torsional_rigidity: float = number("N m^2", 1e-6, 1e4)
    """Torsional stiffness GJ at room temperature [N m^2]; independent of EI, about 13 times it on real scopes."""
    stiffening: float = number("1", 0.1, 20.0, default=1.0)
    """EI at the stiffest setting over EI at the softest [1]; 1 where the setting has no effect."""
    minimum_bend_radius: float | None = number("m", 0.001, 5.0, default=None)
    """Least radius that the section can be bent to [m]; None for no stop."""
    bias_up_deg: float = number("degrees", -720.0, 720.0, default=0.0)
    """Angle that the unloaded section bends through towards wire 'up' [degrees]: a pre-curved scope."""
    bias_left_deg: float = number("degrees", -720.0, 720.0, default=0.0)
    """Angle that the unloaded section bends through towards wire 'left' [degrees]: a pre-curved scope."""


@dataclass(frozen=True)
class BendingLimits:
    """Largest angle over the whole bending section in each direction [degrees]."""

    up: float = number("degrees", 0.1, 1080.0)
    """Largest bend of the whole bending section towards wire 'up' [degrees]."""
    left: float = number("degrees", 0.1, 1080.0)
    """Largest bend of the whole bending section towards wire 'left' [degrees]."""
    down: float = number("degrees", 0.1, 1080.0)
    """Largest bend of the whole bending section towards wire 'down' [degrees]."""
    right: float = number("degrees", 0.1, 1080.0)
    """Largest bend of the whole bending section towards wire 'right' [degrees]."""

    @property
    def largest(self) -> float:
        """Largest of the four angles [degrees]."""
        return max(self.up, self.left, self.down, self.right)

    @property
    def smallest(self) -> float:
        """Smallest of the four angles [degrees]."""
        return min(self.up, self.left, self.down, self.right)


LENSES = ("cf-hq190l", "endomapper", "equidistant")
"""Lenses that a tip may have (`haustra.envs.view.picture.lens`): two calibrated ones, and one whose angles from the
axis are in proportion to radii, over the whole field of view."""


@dataclass(frozen=True)
class ScopeTip:
    """The rigid distal end with its camera and light."""

    length: float = number("m", 1e-9, 0.2)
    """Length of the rigid tip [m]."""
    field_of_view_deg: float = number("degrees", 1.0, 360.0)
    """Full viewing angle of the camera [degrees]."""
    camera_offset_up: float = number("m", -0.03, 0.03, default=0.0)
    """Distance of the camera from the axis, towards wire 'up' [m]."""
    camera_offset_left: float = number("m", -0.03, 0.03, default=0.0)
    """Distance of the camera from the axis, towards wire 'left' [m]."""
    camera_tilt_deg: float = number("degrees", -180.0, 180.0, default=0.0)
    """Angle of the view from the axis, towards wire 'up' [degrees]."""
    lens: str = choice(*LENSES, default="cf-hq190l")
    """Lens of the camera: cf-hq190l or endomapper, both calibrated, or equidistant."""
    light: float = number("1", 0.0, 100.0, default=1.0)
    """Brightness of the light, relative to the renderer's default [1]."""


@dataclass(frozen=True, kw_only=True)
class ScopeDesign:
    """A colonoscope: insertion tube, bending section, pull wires and tip.

    Raises:
        InvalidDesignError: when a value is not what its field declares, or parts do not fit together.
    """

    name: str
    """Name of the design, for people."""
    diameter: float = number("m", 0.001, 0.05)
    """Outer diameter, the same along the scope [m]."""
    mass_per_length: float = number("kg/m", 0.001, 5.0)
    """Mass per length of the scope [kg/m]."""
    relaxation_time: float = number("s", 1e-12, 10.0)
    """Relaxation time of bending and twist: viscous torque per rate over elastic torque per angle [s]."""
    shaft: tuple[ScopeSection, ...]
    """Sections of the insertion tube, from the handle to the bending section."""
    bending: ScopeSection
    """The section that the wires bend."""
    limits: BendingLimits
    wires: WireSet
    tip: ScopeTip
    temperature_factor_bending: float = number("1", 0.1, 10.0, default=1.0)
    """EI in use over EI as given [1]; 1 at room temperature, about 0.83 inside the body."""
    temperature_factor_torsion: float = number("1", 0.1, 10.0, default=1.0)
    """GJ in use over GJ as given [1]; 1 at room temperature, about 0.93 inside the body."""
    variable_stiffness: float = number("1", 0.0, 1.0, default=0.0)
    """Setting of the stiffening ring, from 0 (soft) to 1 (stiff)."""
    working_length: float | None = number("m", 0.05, 20.0, default=None)
    """Length that shaft, bending section and tip should add up to [m]; checked when given."""

    def __post_init__(self) -> None:
        require_declared(self, f"Scope {shown(self.name)}", error=InvalidDesignError)
        self._require_fit()

    @property
    def length(self) -> float:
        """Working length: shaft, bending section and tip [m]."""
        return sum(section.length for section in self.shaft) + self.bending.length + self.tip.length

    def flexural_rigidity(self, section: ScopeSection) -> float:
        """EI of a section in use: at this design's temperature and stiffness setting [N m^2]."""
        return section.flexural_rigidity * self._stiffened(section) * self.temperature_factor_bending

    def left_to_stiffen(self, section: ScopeSection) -> float:
        """By how much of its EI in use the ring can stiffen a section yet [1]."""
        return section.stiffening / self._stiffened(section) - 1

    def _stiffened(self, section: ScopeSection) -> float:
        """EI of a section at this setting of the ring, over EI at the softest [1]."""
        return 1 + self.variable_stiffness * (section.stiffening - 1)

    @property
    def pull_per_angle(self) -> float:
        """Pull that bends the free bending section by an angle [N/rad]: constant curvature, angle = F r L / EI."""
        return self.flexural_rigidity(self.bending) / (self.wires.routing_radius * self.bending.length)

    def torsional_stiffness(self, section: ScopeSection) -> float:
        """GJ of a section in use [N m^2]."""
        return section.torsional_rigidity * self.temperature_factor_torsion

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
        self._require_bias_within_limits(where)
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
