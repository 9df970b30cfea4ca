"""Where a scope twists: few hinges that carry the torsional compliance of its whole length."""

from collections.abc import Sequence

from haustra.models.devices.scope.cells import Cell


def twist_stiffness(cells: Sequence[Cell], count: int) -> dict[int, float]:
    """Cells that carry a twist hinge, and the stiffness of each [N m/rad]: its share of the whole compliance."""
    total = cells[-1].start + cells[-1].length
    stiffness: dict[int, float] = {}
    for lump in range(count):
        share = [cell for cell in cells if total * lump / count <= cell.joint < total * (lump + 1) / count]
        if share:
            middle = cells.index(share[len(share) // 2])
            stiffness[middle] = 1 / sum(cell.length / cell.torsional_rigidity for cell in share)
    return stiffness
