"""The front of run time against error: every colon a world of one batch, and finer models are nearer."""

from dataclasses import replace
from pathlib import Path

import pytest

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.store import save_colon
from haustra.models.presets import find_preset
from haustra.scripts.bench.accuracy import front
from haustra.scripts.bench.accuracy.front import best, measure_front, modelled
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

COARSE, FINE = "shaft_cell=0.1 bending_cell=0.034", "shaft_cell=0.025 bending_cell=0.017"


def test_a_finer_model_is_nearer_and_finished_batches_are_kept(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(front, "REFERENCE", "shaft_cell=0.0125 bending_cell=0.0085")
    monkeypatch.setattr(front, "COARSER", FINE)
    for seed in range(2):
        colon = swept_colon(winding([(0.05, 0.0), (0.06, 1.4 + 0.1 * seed), (0.1, 0.0)]), name="bent tube")
        save_colon(colon, tmp_path / "colons" / f"grown-{seed}")
    asked = {"colons": 2, "designs": ["adult"], "mesentery": [False], "settings": [COARSE], "seconds": 0.8}
    rows = measure_front(tmp_path, **asked)
    found = {row["setting"]: row for row in rows}
    assert len(rows) == 2 and all(row["tracks"] == 2 and not row["fallen"] and row["cost"] > 0 for row in rows)
    assert found[FINE]["tip_mm"] < found[COARSE]["tip_mm"] and found[COARSE]["dofs"] < found[FINE]["dofs"]
    assert measure_front(tmp_path, **asked) == rows


def test_ways_of_modelling_are_presets_or_changes_to_balanced():
    assert modelled("fast") == find_preset("fast").apply(law="table")
    balanced = find_preset("balanced").apply(law="table")
    assert modelled("shaft_cell=0.03 timestep=0.01", mesentery=True) == replace(
        balanced, shaft_cell=0.03, timestep=0.01, mesentery=True
    )
    for wrong in ("finest", "shaft=0.03", "shaft_cell=narrow"):
        with pytest.raises(InvalidOptionError):
            modelled(wrong)


def test_a_front_has_what_nothing_beats_in_cost_and_error():
    rows = [{"cost": cost, "push": error, "fallen": fallen} for cost, error, fallen in
            ((1.0, 0.5, 0), (2.0, 0.6, 0), (3.0, 0.1, 0), (0.5, 0.01, 1))]  # fmt: skip
    assert [row["cost"] for row in best(rows, "push")] == [1.0, 3.0]
