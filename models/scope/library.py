"""Named scope designs, built from the sourced numbers in assets/numbers/scope.toml."""

from haustra.assets import asset
from haustra.errors import InvalidDesignError
from haustra.models.scope.design import BendingLimits, ScopeDesign, ScopeSection, ScopeTip
from haustra.models.scope.wires import WireSet
from haustra.quantity import load_quantities

DESIGN_NAMES = ("adult", "paediatric")
"""Designs that ship."""


def named_design(name: str) -> ScopeDesign:
    """The shipped design of that name.

    Raises:
        InvalidDesignError: when there is none; the message lists those there are.
    """
    if name not in DESIGN_NAMES:
        raise InvalidDesignError(f"Design '{name}' is not known. Known: {', '.join(DESIGN_NAMES)}.")
    numbers = load_quantities(asset("numbers/scope.toml"))

    def number(key: str) -> float:
        return numbers[f"scope.{name}.{key}"].value

    shaft_length = number("working_length") - number("bending_length") - number("tip_length")
    return ScopeDesign(
        name=name,
        diameter=number("diameter"),
        mass_per_length=number("mass_per_length"),
        loss_time=number("loss_time"),
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
        wires=WireSet(routing_radius=number("tendon_routing_radius"), pull_limit=number("tendon_pull_limit")),
        tip=ScopeTip(length=number("tip_length"), field_of_view_deg=number("field_of_view")),
    )
