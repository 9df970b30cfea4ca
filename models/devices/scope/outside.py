"""Shaft that stays outside the patient throughout a run is left out of its scene.

Shaft outside is held straight, so that only its mass and its compliance in twist are felt: the handle gets the first,
the first joint that remains, which stays outside too, gets the second.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from haustra.models.devices.scope.cells import Cell
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.twist import twist_stiffness

SLACK = 0.02
"""Shaft kept outside beyond what can get in [m]: joints are freed over the last 2 cm before the anus."""

_TURN = 4
"""Cells after which hinge axes repeat; whole turns are left out, so that those that remain keep their axes."""


@dataclass(frozen=True)
class Outside:
    """Shaft that is left out, and what it leaves to the rest."""

    length: float = 0.0
    """[m]."""
    mass: float = 0.0
    """Moves with every push [kg]."""
    inertia: float = 0.0
    """About the shaft's axis [kg m^2]."""
    twists: Mapping[int, float] = field(default_factory=dict)
    """Cells of the rest that carry a twist hinge, and the stiffness of each [N m/rad]."""


def leave_out(
    cells: Sequence[Cell], design: ScopeDesign, *, deepest: float, twist_hinges: int
) -> tuple[tuple[Cell, ...], Outside]:
    """Drop cells at the handle's end that stay outside when at most `deepest` metres of scope get in.

    Args:
        cells: of the whole scope, from its handle.
        design: the scope.
        deepest: the most scope that is past the anus [m].
        twist_hinges: of the whole scope.

    Returns:
        The cells that remain, counted from their own handle end, and what was left out.
    """
    length = cells[-1].start + cells[-1].length + design.tip.length
    spare = length - deepest - SLACK
    # One more cell than must: the first that remains is outside, and twists for those that are gone.
    dropped = max(0, sum(cell.start + cell.length <= spare and not cell.steerable for cell in cells) - 1)
    dropped -= dropped % _TURN
    shift = cells[dropped].start
    whole = twist_stiffness(cells, twist_hinges)
    twists = {index - dropped: stiffness for index, stiffness in whole.items() if index >= dropped}
    if gone := [1 / stiffness for index, stiffness in whole.items() if index < dropped]:
        twists[0] = 1 / (sum(gone) + (1 / twists[0] if 0 in twists else 0.0))
    mass = design.mass_per_length * shift
    outside = Outside(length=shift, mass=mass, inertia=mass * design.diameter**2 / 8, twists=twists)
    return tuple(replace(cell, start=cell.start - shift) for cell in cells[dropped:]), outside
