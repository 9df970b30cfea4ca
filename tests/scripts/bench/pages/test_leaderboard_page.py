"""The leaderboard takes what was measured by its protocol, and nothing else."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from haustra.errors import InvalidOptionError
from haustra.scripts.bench.pages.leaderboard_page import main, rows_of

MEANS = dict.fromkeys(("completion", "intubation", "progress", "safe_completion", "p_perforation"), 0.5)
EVALUATION: dict[str, Any] = {
    "task": {
        "difficulty": "any",
        "mesentery": True,
        "privileged": False,
        "randomisation": {"friction": [0.03, 0.1]},
        "limits": {"seconds": 300.0},
        "drive": {"hand_lead": 0.008},
    },
    "drivers": [
        {"driver": "runs/mine", "episodes": 400, "peak_force_N": 20.0, "peak_force_N_bootstrap": [19.0, 21.0]}
        | MEANS
        | {f"{name}_bootstrap": [0.4, 0.6] for name in MEANS}
    ],
    "provenance": {
        "configuration": {"colons": 80},
        "backend": {"backend": "linear-gpu", "device": "gpu NVIDIA H200"},
        "created": "2026-11-23T08:55:12+00:00",
    },
}


def test_a_driver_takes_the_place_of_the_one_of_its_name(tmp_path: Path) -> None:
    page = tmp_path / "leaderboard.md"
    (tmp_path / "data").mkdir()
    better = deepcopy(EVALUATION)
    better["drivers"][0]["completion"] = 0.75
    for number, evaluation in enumerate((EVALUATION, better)):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "evaluation.json").write_text(json.dumps(evaluation), encoding="utf-8")
        main([str(folder)], page)
    rows = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| mine")]
    assert len(rows) == 1 and "0.750 (0.400–0.600)" in rows[0] and "NVIDIA H200, 2026-11-23" in rows[0]


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [("task", "privileged", True), ("task", "mesentery", False), ("limits", "seconds", 600.0)],
)
def test_what_was_measured_otherwise_is_refused_by_name(part: str, name: str, value: Any) -> None:
    other = deepcopy(EVALUATION)
    (other["task"] if part == "task" else other["task"][part])[name] = value
    with pytest.raises(InvalidOptionError, match=f"protocol: {name} differ"):
        rows_of(other, "mine")
