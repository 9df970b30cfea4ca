"""Leaving something out is measured against the scene that has it."""

import pytest

from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.skip import ADVANCE, BOUND, Lever, compare, levers
from tests.bent_colon import bent_colon

SECONDS = 3.0


DESIGN = named_design("adult")


@pytest.fixture(scope="module")
def tube():
    return bent_colon([(0.1, 0.0), (0.08, 1.0), (0.4, 0.0)])


@pytest.fixture(scope="module")
def pairs(tube):
    colon, wall = tube
    found = levers(colon, wall, DESIGN, deepest=SceneOptions.start_depth + ADVANCE * SECONDS)
    return {lever.name: lever for lever in found}


@pytest.mark.parametrize("name", ["shaft that stays outside", "wall out of reach", "picture of the lumen"])
def test_what_is_left_out_changes_no_score(pairs, name: str) -> None:
    lever = pairs[name]
    assert lever.use == "left out"
    row = compare(lever, seconds=SECONDS, repeats=1)
    assert max(row[score] for score in ("tip_change", "push_change", "wall_change")) < BOUND
    assert row["gain"] > 0


def test_a_change_is_seen(tube) -> None:
    """A wall half as stiff is not the same scene."""
    colon, wall = tube
    soft, hard = (
        build_scene(colon, wall, DESIGN, SceneOptions(wall_stiffness=stiffness), show_lumen=False)
        for stiffness in (750.0, 1500.0)
    )
    row = compare(Lever("half the wall", soft, hard), seconds=SECONDS, repeats=1)
    assert max(row[score] for score in ("tip_change", "push_change", "wall_change")) > BOUND
