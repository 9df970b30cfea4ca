"""`haustra trials` tells each trial's answer in one line, or all of them as one document."""

import json
from pathlib import Path

import pytest

from haustra.envs.study.trials import Answer, load_trial
from haustra.scripts.main import main


def _answers(names: tuple[str, ...], *given: object, **asked: object) -> list[Answer]:
    known = {"flaccid": (-48.6, -102.0, -7.3), "ultrathin": (-0.1, -0.2, 0.0), "water": (None, None, None)}
    found = []
    for name in names:
        effect, low, high = known[name]
        told = {"first": effect, "second": 0.0, "effect": effect, "low": low, "high": high, "arrived": None}
        found.append(Answer(name, load_trial(name)[0], 96, reached=(0.9, 0.9), **told))
    return found


@pytest.mark.parametrize("as_json", [False, True])
def test_a_line_says_effect_and_verdict(as_json: bool, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("haustra.envs.study.trials.run_trials", _answers)
    monkeypatch.setenv("COLUMNS", "200")
    asked = ["trials", "flaccid", "ultrathin", "water", "-o", str(tmp_path), *(["--json"] if as_json else [])]
    assert main(asked) == 0
    said = capsys.readouterr().out
    if as_json:
        trials = json.loads(said)["trials"]
        assert [one["reproduced"] for one in trials] == [True, False, False]
        assert trials[0]["effect"] == -48.6 and trials[2]["low"] is None
    else:
        assert "-48.6 s (-102 to -7.3), 96 pairs; published different: reproduced, resolved" in said
        assert "-0.1 (-0.2 to +0), 96 pairs; published equal: NOT reproduced" in said
        assert "too few patients" in said
    assert len(json.loads((tmp_path / "trials.json").read_text("utf-8"))["trials"]) == 3
