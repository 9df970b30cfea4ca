"""A page of validation whose measurements are kept is made from them: no page is older than its JSON."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from haustra.scripts.bench.pages.agreement_page import agreement_page
from haustra.scripts.bench.pages.causes_page import causes_page
from haustra.scripts.bench.pages.cells_page import cells_page
from haustra.scripts.bench.pages.cohort_page import validation_page
from haustra.scripts.bench.pages.commands_page import commands_page
from haustra.scripts.bench.pages.compare_page import compare_page
from haustra.scripts.bench.pages.front_page import front_page
from haustra.scripts.bench.pages.gas_page import gas_page
from haustra.scripts.bench.pages.leaderboard_page import leaderboard_page
from haustra.scripts.bench.pages.motion_page import motion_page
from haustra.scripts.bench.pages.propulsion_page import propulsion_page
from haustra.scripts.bench.pages.reach_page import reach_page
from haustra.scripts.bench.pages.sight_page import sight_page
from haustra.scripts.bench.pages.teaching_page import teaching_page
from haustra.scripts.bench.pages.trials_page import trials_page

PAGES = Path(__file__).parents[4] / "docs" / "validation"
MAKERS: Mapping[str, Callable[[Any], str]] = {
    "agreement": agreement_page,
    "causes": causes_page,
    "injury-causes": lambda kept: causes_page(kept, page="injury-causes"),
    "cells": cells_page,
    "commands": commands_page,
    "cohort": lambda kept: validation_page(kept["cohorts"]),
    "accuracy": front_page,
    "devices": compare_page,
    "gas": gas_page,
    "motion": motion_page,
    "reach": reach_page,
    "sight-reference": sight_page,
    "tracked": propulsion_page,
    "leaderboard": lambda kept: leaderboard_page(kept["rows"]),
    "teaching": teaching_page,
    "trials": trials_page,
}
"""What makes the page of each file in docs/validation/data, by its name."""


@pytest.mark.parametrize("kept", sorted((PAGES / "data").glob("*.json")), ids=lambda path: path.stem)
def test_the_page_is_made_from_what_is_kept(kept: Path) -> None:
    page = (PAGES / f"{kept.stem}.md").read_text(encoding="utf-8")
    measured = json.loads(kept.read_text(encoding="utf-8"))
    assert page == MAKERS[kept.stem](measured), "make the page anew from the file"
