"""Examining the same virtual patients at several time steps and precisions."""

import json

import pytest

from haustra.scripts.bench.steps import WAYS
from haustra.scripts.main import BAD_INPUT, main


def test_one_patient_of_a_cohort_is_examined_in_every_way(tmp_path, capsys) -> None:
    """And once, however often it is named."""
    asked = ["bench", "steps", "-o", str(tmp_path), "--patients", "3", "--only", "1", "1", "--seconds", "3", "--json"]
    assert main(asked) == 0
    ways = json.loads(capsys.readouterr().out)["ways"]
    assert [(way["timestep"], way["precision"]) for way in ways] == list(WAYS)
    loads = [way["load_peak"] for way in ways]
    assert [way["patients"] for way in ways] == [1] * len(ways)
    assert [way["time_s"] for way in ways] == pytest.approx([3.0] * len(ways), rel=1e-4)
    assert len(set(loads)) == len(loads)
    assert loads == pytest.approx([loads[-1]] * len(loads), rel=0.1)


def test_a_patient_whom_the_cohort_does_not_have_is_refused(tmp_path, capsys) -> None:
    assert main(["bench", "steps", "-o", str(tmp_path), "--patients", "3", "--only", "3", "--json"]) == BAD_INPUT
    assert "--only: patient 3" in capsys.readouterr().err
