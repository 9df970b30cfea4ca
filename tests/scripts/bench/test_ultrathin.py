"""Scopes between an ultrathin and a standard one: each differs in what it says, and in nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest

from haustra.envs.control.laws import driver_settings
from haustra.scripts.bench.ultrathin import LONGER, STANDARD, ULTRATHIN, scopes, sucking_driver
from haustra.scripts.main import BAD_INPUT, main

SCOPES = scopes()


@pytest.mark.parametrize("what", SCOPES)
def test_scopes_are_as_long_as_their_arm_of_the_trial(what: str) -> None:
    arm = SCOPES[what.partition(",")[0]]
    assert SCOPES[what].length == pytest.approx(arm.length + LONGER * what.endswith("longer"))


@pytest.mark.parametrize("what", [what for what in SCOPES if "," in what])
def test_scopes_differ_from_their_arm_in_the_shaft_alone(what: str) -> None:
    arm, found = SCOPES[what.partition(",")[0]], SCOPES[what]
    assert found.shaft != arm.shaft
    assert replace(found, shaft=arm.shaft, name=arm.name) == arm


def test_each_scope_has_a_file_of_its_own() -> None:
    assert len({each.name for each in SCOPES.values()}) == len(SCOPES) > len({STANDARD, ULTRATHIN})


def test_too_few_patients_are_refused(tmp_path, capsys) -> None:
    assert main(["bench", "ultrathin", "-o", str(tmp_path), "--patients", "2", "--json"]) == BAD_INPUT
    assert "--patients" in capsys.readouterr().err


def test_the_one_who_sucks_differs_in_that_alone(tmp_path) -> None:
    usual, sucks = (
        driver_settings(name, moves=True) for name in ("endoscopist", str(sucking_driver(tmp_path / "a.toml")))
    )
    assert replace(sucks, suck_after=usual.suck_after) == usual
    assert sucks.suck_after < usual.most_attempts < usual.suck_after


def test_the_example_is_the_one_who_sucks() -> None:
    path = Path(__file__).parents[3] / "docs/examples/suction.toml"
    assert driver_settings(str(path), moves=True).suck_after == 1
