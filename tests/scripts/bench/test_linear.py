"""`haustra bench linear --json` prints what it is asked for, at a size for tests."""

import json
from functools import partial

import pytest

from haustra.envs.sim.scope_bank import build_bank
from haustra.models.devices.scope.library import named_design
from haustra.scripts.bench import linear
from haustra.scripts.main import SUCCESS, main
from tests.tube_colon import straight_tube


def test_its_json_holds_rows_exponent_and_difference(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a short tube, with few worlds to compare with the dense step."""
    bank = build_bank([straight_tube()], named_design("adult"))
    monkeypatch.setattr(linear, "bank_of", lambda dofs, mesentery: bank)
    monkeypatch.setattr(linear, "largest_difference", partial(linear.largest_difference, worlds=2, instants=1))
    assert main(["bench", "linear", "--json", "--worlds", "1", "--dofs", "40,80"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found.keys() >= {"rows", "exponent", "largest_difference"}
    assert all(row.keys() >= {"dofs", "worlds", "us_per_step", "us_per_step_dense"} for row in found["rows"])
    assert len(found["rows"]) == 2 and all(row["us_per_step"] > 0 for row in found["rows"])
    assert 0 <= found["largest_difference"] < 1e-9
