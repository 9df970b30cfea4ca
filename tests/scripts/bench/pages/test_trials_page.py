"""The page of trials takes some trials in the place of those that were asked for alike, and none beside others."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from haustra.errors import InvalidOptionError
from haustra.scripts.bench.pages.trials_page import OTHERS, SOFT_FRONT, main

SHIPPED = json.loads((Path(__file__).parents[4] / "docs/validation/data/trials.json").read_text("utf-8"))
KEPT = SHIPPED | {SOFT_FRONT: {"asked": SHIPPED["asked"], "trials": SHIPPED["trials"][:1]}}


def _page(folder: Path, found: dict[str, Any]) -> dict[str, Any]:
    """What is kept beside a page once that was found."""
    kept = folder / "data" / "trials.json"
    kept.parent.mkdir()
    kept.write_text(json.dumps(KEPT), encoding="utf-8")
    source = folder / "trials.json"
    source.write_text(json.dumps(found), encoding="utf-8")
    main(folder / "trials.md", [source])
    return json.loads(kept.read_text("utf-8"))


def test_some_trials_alone_leave_the_others(tmp_path: Path) -> None:
    usual = deepcopy(KEPT)
    anew = usual["trials"][2] | {"effect": 12.5}
    table = _page(tmp_path, {"asked": usual["asked"], "trials": [anew]})
    assert table["trials"] == [anew if one["name"] == anew["name"] else one for one in usual["trials"]]
    assert table[SOFT_FRONT] == KEPT[SOFT_FRONT]
    assert "+12.5 (" in (tmp_path / "trials.md").read_text("utf-8")


def test_trials_that_were_asked_for_otherwise_stand_alone(tmp_path: Path) -> None:
    other = {"asked": KEPT["asked"] | {"patients": 9}, "trials": KEPT["trials"][:1]}
    table = _page(tmp_path, other)
    assert [one["name"] for one in table["trials"]] == [KEPT["trials"][0]["name"]]
    assert table[SOFT_FRONT] == KEPT[SOFT_FRONT]


def test_trials_with_other_patients_have_a_section_of_their_own(tmp_path: Path) -> None:
    other = {"asked": KEPT["asked"] | {"seed": 9}, "trials": KEPT["trials"][:1]}
    table = _page(tmp_path, other)
    assert table[OTHERS] == other and table["trials"] == KEPT["trials"]
    told = (tmp_path / "trials.md").read_text("utf-8").partition("## Other patients")[2]
    assert "--seed 9" in told and KEPT["trials"][0]["name"] in told


def test_trials_of_another_driver_are_refused(tmp_path: Path) -> None:
    other = {"asked": KEPT["asked"] | {"driver": "follower"}, "trials": KEPT["trials"][:1]}
    with pytest.raises(InvalidOptionError, match="driven by follower"):
        _page(tmp_path, other)
    assert not (tmp_path / "trials.md").exists()
