"""Named scope designs, built from the sourced numbers in assets/numbers/scope.toml."""

from dataclasses import replace
from functools import cache

from haustra.assets import asset
from haustra.errors import InvalidDesignError
from haustra.models.devices.scope.design import BendingLimits, ScopeDesign, ScopeSection, ScopeTip
from haustra.models.devices.scope.wires import WireSet
from haustra.quantity import Quantity, load_quantities

DESIGN_NAMES = ("adult", "paediatric", "adult-worn", "adult-variable", "paediatric-long")
"""Designs that ship: two new scopes; the adult one with the wires of a used scope; and with a stiffening ring; and the
paediatric one as long as an enteroscope, with a shaft that does not fold."""


def named_design(name: str) -> ScopeDesign:
    """The shipped design of that name.

    Raises:
        InvalidDesignError: when there is none; the message lists those there are.
    """
    if name not in DESIGN_NAMES:
        raise InvalidDesignError(f"Design '{name}' is not known. Known: {', '.join(DESIGN_NAMES)}.")
    basic = _basic(name.partition("-")[0])
    if name == "adult-worn":
        return replace(basic, name=name, wires=_worn(basic.wires))
    if name == "adult-variable":
        stiffening = _numbers()["scope.variable.stiffening"].value
        shaft = tuple(replace(section, stiffening=stiffening) for section in basic.shaft)
        return replace(basic, name=name, shaft=shaft)
    if name == "paediatric-long":
        numbers = _numbers()
        added = numbers["scope.long.working_length"].value - basic.length
        tightest = numbers["scope.long.minimum_bend_radius"].value
        shaft = tuple(
            replace(section, length=section.length + added, minimum_bend_radius=tightest) for section in basic.shaft
        )
        return replace(basic, name=name, shaft=shaft)
    return basic


def at_body_temperature(design: ScopeDesign) -> ScopeDesign:
    """The design as it is inside a patient, at 37 degrees Celsius: softer than on the bench.

    A design that states its own factors of temperature is left as it is.
    """
    if (design.temperature_factor_bending, design.temperature_factor_torsion) != (1.0, 1.0):
        return design
    numbers = _numbers()
    return replace(
        design,
        temperature_factor_bending=numbers["scope.temperature.flexural_rigidity_factor"].value,
        temperature_factor_torsion=numbers["scope.temperature.torsional_rigidity_factor"].value,
    )


@cache
def _numbers() -> dict[str, Quantity]:
    return load_quantities(asset("numbers/scope.toml"))


def _worn(wires: WireSet) -> WireSet:
    names = ("friction", "slack", "compliance", "hysteresis")
    return replace(wires, **{name: _numbers()[f"scope.worn.{name}"].value for name in names})


def _basic(name: str) -> ScopeDesign:
    numbers = _numbers()

    def number(key: str) -> float:
        return numbers[f"scope.{name}.{key}"].value

    shaft_length = number("working_length") - number("bending_length") - number("tip_length")
    return ScopeDesign(
        name=name,
        diameter=number("diameter"),
        mass_per_length=number("mass_per_length"),
        relaxation_time=number("relaxation_time"),
        shaft=(
            ScopeSection(
                length=shaft_length,
                flexural_rigidity=number("flexural_rigidity"),
                torsional_rigidity=number("torsional_rigidity"),
            ),
        ),
        bending=ScopeSection(
            length=number("bending_length"),
            flexural_rigidity=number("bending_flexural_rigidity"),
            torsional_rigidity=number("bending_torsional_rigidity"),
        ),
        limits=BendingLimits(
            up=number("tip_angle_up_down"),
            left=number("tip_angle_left_right"),
            down=number("tip_angle_up_down"),
            right=number("tip_angle_left_right"),
        ),
        wires=WireSet(
            routing_radius=number("tendon_routing_radius"),
            pull_limit=number("tendon_pull_limit"),
            compliance=number("tendon_compliance"),
        ),
        tip=ScopeTip(length=number("tip_length"), field_of_view_deg=number("field_of_view")),
    )
