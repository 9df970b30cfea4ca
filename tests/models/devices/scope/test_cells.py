from itertools import pairwise

import pytest

from haustra.models.devices.scope.cells import cut_into_cells
from haustra.models.devices.scope.library import named_design


def test_cells_tile_the_flexible_length_without_gaps():
    design = named_design("adult")
    cells = cut_into_cells(design, shaft_cell=0.04, bending_cell=0.0125)
    assert cells[0].start == 0
    for cell, following in pairwise(cells):
        assert following.start == pytest.approx(cell.start + cell.length)
    assert cells[-1].start + cells[-1].length + design.tip.length == pytest.approx(design.length)
    assert sum(cell.length for cell in cells if cell.steerable) == pytest.approx(design.bending.length)


def test_compliance_is_that_of_the_scope_whatever_the_cells():
    design = named_design("adult")
    expected = sum(section.length / section.flexural_rigidity for section in (*design.shaft, design.bending))
    for size in (0.1, 0.033, 0.01):
        cells = cut_into_cells(design, shaft_cell=size, bending_cell=size)
        assert sum(1 / cell.joint_stiffness for cell in cells) == pytest.approx(expected)


def test_only_the_part_that_enters_is_modelled():
    design = named_design("adult")
    cells = cut_into_cells(design, shaft_cell=0.04, bending_cell=0.0125, length=0.6)
    assert cells[-1].start + cells[-1].length + design.tip.length == pytest.approx(0.6)
