"""Scopes between an ultrathin and a standard one: each differs in what it says, and in nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest

from haustra.envs.control.laws import driver_settings
from haustra.scripts.bench.ultrathin import LONGER, STANDARD, ULTRATHIN, gas_leaving_driver, scopes
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


def test_who_leaves_the_gas_differs_in_that_alone(tmp_path) -> None:
    usual, leaves = (
        driver_settings(name, moves=True) for name in ("endoscopist", str(gas_leaving_driver(tmp_path / "a.toml")))
    )
    assert replace(leaves, suck_after=usual.suck_after, suck_from=usual.suck_from) == usual
    assert usual.suck_after < usual.most_attempts < leaves.suck_after
    assert usual.suck_from < 1.5 < 10.0 < leaves.suck_from  # m; no colon is longer than that


def test_the_example_is_the_one_who_leaves_the_gas(tmp_path) -> None:
    example = Path(__file__).parents[3] / "docs/examples/gas-left.toml"
    own = gas_leaving_driver(tmp_path / "a.toml")
    assert driver_settings(str(example), moves=True) == driver_settings(str(own), moves=True)
