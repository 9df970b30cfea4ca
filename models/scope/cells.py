"""Where the joints of a cable go: the scope cut into cells, one bending joint in the middle of each."""

import math
from dataclasses import dataclass

from haustra.models.scope.design import ScopeDesign, ScopeSection


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
    """Bending stiffness EI [N m^2]."""
    torsional_rigidity: float
    """Torsional stiffness GJ [N m^2]."""
    steerable: bool
    """True in the bending section."""

    @property
    def joint(self) -> float:
        """Distance of the joint from the handle end [m]."""
        return self.start + self.length / 2

    @property
    def bending_stiffness(self) -> float:
        """Torque per angle of the joint, EI / length [N m/rad]."""
        return self.flexural_rigidity / self.length


def cut_into_cells(
    design: ScopeDesign, *, shaft_cell: float, bending_cell: float, length: float | None = None
) -> tuple[Cell, ...]:
    """Cut a scope into cells, from its handle end to its bending section.

    Args:
        design: the scope.
        shaft_cell: largest cell length in the shaft [m].
        bending_cell: largest cell length in the bending section [m].
        length: how much of the scope to model, measured back from the tip [m]; all of it when None. The rest stays
            outside the patient throughout the run and is left out.

    Returns:
        Cells whose lengths add up to `length` less the rigid tip.
    """
    modelled = design.length if length is None else min(length, design.length)
    skipped = design.length - modelled
    cells: list[Cell] = []
    start = 0.0
    for section in design.shaft:
        kept = section.length - max(0.0, skipped)
        skipped -= section.length
        if kept > 0:
            start = _append(cells, section, kept, start, shaft_cell, steerable=False)
    _append(cells, design.bending, design.bending.length, start, bending_cell, steerable=True)
    return tuple(cells)


def _append(
    cells: list[Cell], section: ScopeSection, length: float, start: float, largest: float, *, steerable: bool
) -> float:
    count = math.ceil(length / largest - 1e-9)  # a length that is a whole number of cells keeps that number
    for index in range(count):
        cells.append(
            Cell(
                start=start + index * length / count,
                length=length / count,
                flexural_rigidity=section.flexural_rigidity,
                torsional_rigidity=section.torsional_rigidity,
                steerable=steerable,
            )
        )
    return start + length
