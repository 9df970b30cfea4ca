"""Episodes of a coarse and of a fine scope, alike but for that."""

import pytest

from haustra.errors import InvalidOptionError
from haustra.scripts.bench.cells import CELLS, bench_cells
from haustra.scripts.bench.pages.cells_page import cells_page
from haustra.scripts.bench.verbs.cells import BenchCells


def test_every_scope_has_its_row_and_finer_ones_more_joints() -> None:
    names = ["62.5, 34, 31.5", "35, 11.4, 8.4"]
    rows = bench_cells(["insertion"], cells=names, colons=2, seconds=1.0, threads=2, processes=1)
    assert [row["cells"] for row in rows] == names
    assert 40 < rows[0]["dofs"] < rows[1]["dofs"] < 200
    assert all(row["episodes"] == 2 and 0 <= row["p_perforation"] < 0.01 and row["s_per_s"] > 0 for row in rows)
    page = cells_page({"rows": rows, "machine": {"processor": "a processor", "date": "2026-11-24"}})
    assert all(f"| `insertion`, {name} |" in page for name in names)


def test_cells_that_are_not_known_are_refused(tmp_path) -> None:
    with pytest.raises(InvalidOptionError, match="not known"):
        BenchCells(output=tmp_path, cells="1, 2, 3")()
    assert len(CELLS) == 7
