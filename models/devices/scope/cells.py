"""Where the joints of a cable go: the scope cut into cells, one bending joint in the middle of each."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.design import ScopeDesign, ScopeSection

MOST_CELLS = 450
"""Joints of a scope: MuJoCo's files hold bodies within bodies up to 500 deep."""
CellSize = float | Callable[[float], float]
"""Largest cell length [m], or a function that gives it for a distance from the tip [m]."""


@dataclass(frozen=True)
class Cell:
    """A short length of scope whose bend is concentrated in a joint at its middle.

    A joint of stiffness EI/length at mid-cell integrates curvature by the midpoint rule, so that the shape converges
    with the square of the cell length; a clamped end needs no special joint (half a cell of rigid link stands there).
    """

    start: float
    """Distance from the handle end [m]."""
    length: float
    """Cell length [m]."""
    flexural_rigidity: float
    """Bending stiffness EI in use [N m^2]."""
    torsional_rigidity: float
    """Torsional stiffness GJ in use [N m^2]."""
    steerable: bool
    """True in the bending section."""
    bias_up: float = 0.0
    """Angle of the unloaded joint towards wire 'up' [rad]."""
    bias_left: float = 0.0
    """Angle of the unloaded joint towards wire 'left' [rad]."""
    largest: tuple[float, float, float, float] | None = None
    """Largest angle towards up, left, down, right [rad]; None for no stop."""
    left_to_stiffen: float = 0.0
    """By how much of its EI a stiffening ring that is turned on command stiffens it [1]; 0 in the bending section."""

    @property
    def joint(self) -> float:
        """Distance of the joint from the handle end [m]."""
        return self.start + self.length / 2

    @property
    def joint_stiffness(self) -> float:
        """Torque per angle of the joint, EI / length [N m/rad]."""
        return self.flexural_rigidity / self.length


def cut_into_cells(
    design: ScopeDesign, *, shaft_cell: CellSize, bending_cell: CellSize, length: float | None = None
) -> tuple[Cell, ...]:
    """Cut a scope into cells, from its handle end to its bending section.

    Args:
        design: the scope.
        shaft_cell: largest cell length in the shaft.
        bending_cell: largest cell length in the bending section.
        length: how much of the scope to model, measured back from the tip [m]; all of it when None. The rest stays
            outside the patient throughout the run and is left out.

    Raises:
        InvalidOptionError: when cells are so small that there are more than `MOST_CELLS`.

    Returns:
        Cells whose lengths add up to `length` less the rigid tip.
    """
    modelled = design.length if length is None else min(length, design.length)
    bent = design.bending.length
    _require_few([(max(modelled - bent, 0.0), shaft_cell), (bent, bending_cell)])
    skipped = design.length - modelled
    cells: list[Cell] = []
    start = 0.0
    for section in design.shaft:
        kept = section.length - max(0.0, skipped)
        skipped -= section.length
        if kept > 0:
            for size in _sizes(kept, modelled - start, shaft_cell):
                cells.append(_cell(design, section, start, size, steerable=False))
                start += size
    for size in _sizes(design.bending.length, modelled - start, bending_cell):
        cells.append(_cell(design, design.bending, start, size, steerable=True))
        start += size
    return tuple(cells)


def _require_few(stretches: Sequence[tuple[float, CellSize]]) -> None:
    """Refuse cells so small that a scope has more of them than can be stepped in any sensible time."""
    count = sum(length / size for length, size in stretches if not callable(size))
    if count > MOST_CELLS:
        raise InvalidOptionError(
            f"A scope in cells of {' and '.join(f'{size} m' for _, size in stretches if not callable(size))} has "
            f"{count:.0f} joints, more than {MOST_CELLS}: raise shaft_cell or bending_cell."
        )


def _sizes(length: float, from_tip: float, largest: CellSize) -> list[float]:
    """Cell lengths that fill a stretch which begins `from_tip` behind the tip."""
    if not callable(largest):
        count = math.ceil(length / largest - 1e-9)  # a length that is a whole number of cells keeps that number
        return [length / count] * count
    # Walk with the size asked for at each place, then shrink all alike to end where the stretch ends.
    sizes: list[float] = []
    while sum(sizes) < length - 1e-9:
        sizes.append(largest(from_tip - sum(sizes)))
    scale = length / sum(sizes)
    return [size * scale for size in sizes]


def _cell(design: ScopeDesign, section: ScopeSection, start: float, length: float, *, steerable: bool) -> Cell:
    share = length / section.length
    if steerable:
        limits = design.limits
        up, left, down, right = (
            math.radians(angle) * share for angle in (limits.up, limits.left, limits.down, limits.right)
        )
        tightest = length / (section.minimum_bend_radius or math.inf) or math.inf
        stop = (min(up, tightest), min(left, tightest), min(down, tightest), min(right, tightest))
    elif section.minimum_bend_radius is not None:
        tightest = length / section.minimum_bend_radius
        stop = (tightest, tightest, tightest, tightest)
    else:
        stop = None
    return Cell(
        start=start,
        length=length,
        flexural_rigidity=design.flexural_rigidity(section),
        torsional_rigidity=design.torsional_stiffness(section),
        steerable=steerable,
        bias_up=math.radians(section.bias_up_deg) * share,
        bias_left=math.radians(section.bias_left_deg) * share,
        largest=stop,
        left_to_stiffen=0.0 if steerable else design.left_to_stiffen(section),
    )
