"""Scopes between an ultrathin and a standard one: each differs in what it says, and in nothing else."""

from dataclasses import replace

import pytest

from haustra.scripts.bench.ultrathin import LONGER, STANDARD, ULTRATHIN, scopes
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
