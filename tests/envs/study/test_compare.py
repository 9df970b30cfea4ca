"""Devices side by side: the same patients, paired differences, and nothing lost when it is stopped."""

import json

import numpy as np
import pytest

from haustra.envs.study.compare import comparison
from haustra.envs.study.compare_patients import FRICTION, WALL_STIFFNESS, patients
from haustra.envs.study.compare_table import paired_interval, summarise
from haustra.errors import InvalidDesignError, InvalidOptionError
from haustra.scripts.main import BAD_INPUT, SUCCESS, main


def test_patients_are_a_latin_hypercube():
    """Each quarter of each range holds one of four."""
    four = patients("quick")
    for name, (low, high) in (("friction", FRICTION), ("wall_stiffness", WALL_STIFFNESS)):
        quarters = [int(4 * (getattr(one, name) - low) / (high - low)) for one in four]
        assert sorted(quarters) == [0, 1, 2, 3]
    assert patients("quick") == four and not {one.seed for one in four} & {one.seed for one in patients("standard")}


def test_what_cannot_be_compared_is_refused(tmp_path, capsys):
    with pytest.raises(InvalidOptionError, match="Give two or more devices, each once"):
        comparison(["capsule"], "smoke")
    with pytest.raises(InvalidOptionError, match="Two devices are called 'adult'"):
        comparison(["adult", _copy(tmp_path)], "smoke")
    with pytest.raises(InvalidDesignError, match="Device 'broom' is not known"):
        comparison(["capsule", "broom"], "smoke")
    assert main(["compare", "capsule", "vine", "--cohort", "none", "-o", str(tmp_path / "out")]) == BAD_INPUT
    assert "Cohort 'none' is not known" in capsys.readouterr().err


def _copy(folder) -> str:
    from haustra.models.devices.scope.files import save_design
    from haustra.models.devices.scope.library import named_design

    return str(save_design(named_design("adult"), folder / "adult.toml"))


def test_an_interval_is_students():
    """Mean 2 with deviation 1 of four: 2 -+ 3.182 / 2."""
    found = paired_interval(np.array([1.0, 1.0, 3.0, 3.0]) / 1.0)
    half = 3.182446 * np.std([1, 1, 3, 3], ddof=1) / 2
    assert found == pytest.approx((2.0, 2.0 - half, 2.0 + half), rel=1e-5)
    assert paired_interval(np.array([1.5])) == (1.5, None, None)


def test_pairs_are_of_the_same_patients():
    """What only one device has of a patient does not count."""
    rows = [
        {
            "device": device,
            "patient": patient,
            "reach": reach,
            "outcome": "stuck",
            "pain_site": "none",
            "mesentery": 1.0,
        }
        for device, patient, reach in (
            ("a", "p0", 0.5),
            ("a", "p1", 0.7),
            ("a", "p2", 0.1),
            ("b", "p0", 0.6),
            ("b", "p1", 1.0),
        )
    ]
    told = summarise(rows, ["a", "b"])
    assert [one["reach_mean"] for one in told["devices"]] == pytest.approx([1.3 / 3, 0.8])
    pair = next(pair for pair in told["pairs"] if pair["score"] == "reach")
    assert (pair["first"], pair["second"], pair["patients"]) == ("a", "b", 2)
    assert pair["difference"] == pytest.approx(0.2) and pair["low"] < 0.2 < pair["high"]
    assert next(pair for pair in told["pairs"] if pair["score"] == "pain")["difference"] is None


def test_it_is_killed_and_goes_on_without_loss(tmp_path, capsys, monkeypatch):
    """The second call computes only what the first had not, and tells what one call tells."""
    from haustra.envs.study import store

    call = ["compare", "capsule", "inchworm", "--cohort", "smoke", "--seconds", "1", "--workers", "1", "--json"]
    whole = tmp_path / "whole"
    assert main([*call, "-o", str(whole)]) == SUCCESS
    told = json.loads(capsys.readouterr().out)
    assert {one["name"] for one in told["devices"]} == {"capsule", "inchworm"}
    wanted = {"name", "intubation", "reach_mean", "wall_force_peak_mean_N", "mesentery_extension_mean_mm"}
    wanted |= {"p_perforation_mean", "pain_mean", "stopped_by"}
    assert all(wanted <= set(one) for one in told["devices"]) and not told["lost"]
    assert all({"first", "second", "score", "difference", "low", "high"} <= set(pair) for pair in told["pairs"])
    for name in ("report.html", "runs.csv", "devices.csv", "pairs.csv", "paper.tex", "pictures/capsule.png"):
        assert (whole / name).stat().st_size > 100, name
    stopped, kept = tmp_path / "stopped", store.SweepStore.record

    def record_two(self, result):
        if self.counts()["finished"] == 2:
            raise KeyboardInterrupt
        return kept(self, result)

    monkeypatch.setattr(store.SweepStore, "record", record_two)
    with pytest.raises(KeyboardInterrupt):
        _run(call, stopped)
    monkeypatch.undo()
    assert main([*call, "-o", str(stopped), "--resume"]) == SUCCESS
    again = json.loads(capsys.readouterr().out)
    assert (again["devices"], again["pairs"]) == (told["devices"], told["pairs"])


def _run(call, folder):
    if main([*call, "-o", str(folder)]) == 130:
        raise KeyboardInterrupt
