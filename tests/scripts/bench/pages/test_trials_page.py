"""The page of trials takes some trials in the place of those that were asked for alike, and none beside others."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from haustra.scripts.bench.pages.trials_page import SUCTION, main

KEPT = json.loads((Path(__file__).parents[4] / "docs/validation/data/trials.json").read_text("utf-8"))


def _page(folder: Path, found: dict[str, Any]) -> dict[str, Any]:
    """What is kept beside a page once that was found."""
    kept = folder / "data" / "trials.json"
    kept.parent.mkdir()
    kept.write_text(json.dumps(KEPT), encoding="utf-8")
    source = folder / "trials.json"
    source.write_text(json.dumps(found), encoding="utf-8")
    main(folder / "trials.md", [source])
    return json.loads(kept.read_text("utf-8"))


@pytest.mark.parametrize("suction", [False, True])
def test_some_trials_alone_leave_the_others(tmp_path: Path, suction: bool) -> None:
    usual = deepcopy(KEPT[SUCTION] if suction else KEPT)
    anew = usual["trials"][2] | {"effect": 12.5}
    table = _page(tmp_path, {"asked": usual["asked"], "trials": [anew]})
    expected = [anew if one["name"] == anew["name"] else one for one in usual["trials"]]
    changed, left = (table[SUCTION], table) if suction else (table, table[SUCTION])
    assert changed["trials"] == expected
    assert left["trials"] == (KEPT if suction else KEPT[SUCTION])["trials"]
    assert "+12.5 (" in (tmp_path / "trials.md").read_text("utf-8")


def test_trials_with_other_patients_stand_alone(tmp_path: Path) -> None:
    other = {"asked": KEPT["asked"] | {"seed": 9}, "trials": KEPT["trials"][:1]}
    table = _page(tmp_path, other)
    assert [one["name"] for one in table["trials"]] == [KEPT["trials"][0]["name"]]
    assert table[SUCTION] == KEPT[SUCTION]
