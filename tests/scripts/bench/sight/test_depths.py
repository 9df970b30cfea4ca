"""Every renderer is asked for the same wall, and what is not there is named."""

import pytest

from haustra.scripts.bench.pages.sight_page import sight_page
from haustra.scripts.bench.sight import depths
from tests.task_bank import moving_bank


def test_renderers_see_the_same_wall_and_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exact rays are MuJoCo's; rays in tables are within the table's own errors; JAX and Warp are left out here."""
    monkeypatch.setattr(depths, "find_spec", lambda name: None)
    monkeypatch.setattr(depths, "has_mitsuba", lambda: False)
    rows = depths.bench_depths(moving_bank(), worlds=2, size=20, seconds=0.3, motions=(True,))
    known = {row["renderer"]: row for row in rows}
    exact = known["exact rays (CPU)"]
    assert exact["p99_mm"] < 0.001 and exact["pixels"] > 300
    assert known["programs of linear time (CPU)"]["median_mm"] < 0.2
    assert known["depth pictures, numpy"]["median_mm"] < 1.0
    assert "JAX" in known["depth pictures, JAX"]["missing"] and "Mitsuba" in known["Mitsuba"]["missing"]
    about = {"size": 20, "samples": 2, "worlds": 2, "seconds": 1.0}
    page = sight_page({"about": about, "depths": rows, "reference": []})
    assert "not measured: JAX is not installed" in page and "Mitsuba was not installed" in page
