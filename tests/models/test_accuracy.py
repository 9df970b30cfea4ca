"""Runs state the error that was measured for their wall, preset and kind of colon, as a range over many colons."""

from dataclasses import replace

import pytest

from haustra.assets import asset
from haustra.errors import HaustraError
from haustra.models.accuracy import LEAST_COLONS, NOT_MEASURED, kind_of, load_measured, stated_error
from haustra.models.presets import find_preset
from haustra.models.scene import SceneOptions
from tests.tube_colon import straight_tube

MEASURED = find_preset("balanced").apply(SceneOptions(wall_law="table", mesentery=True), law="table")
"""Options of the default run."""


def test_walls_of_pieces_state_what_ten_colons_showed():
    """Single colons differ by ten times: the one value that every run once stated (3.8 %) is within their range."""
    low, high = stated_error(SceneOptions(wall_law="pieces"), "grown", wall="prism").wall_force
    assert low is not None and high is not None and low < 0.02 and high > 0.1


@pytest.mark.parametrize(
    ("options", "colon", "wall"),
    [
        (SceneOptions(wall_law="pieces"), "grown", "a wall that nobody measured"),
        (SceneOptions(wall_law="pieces", timestep=0.004), "grown", "prism"),
        (replace(MEASURED, elasticity="exponential"), "grown", None),
        (replace(MEASURED, friction_rise=0.1), "grown", None),
    ],
)
def test_what_nobody_measured_is_not_stated(options, colon, wall):
    stated = stated_error(options, colon, wall=wall)
    assert stated is NOT_MEASURED
    nothing = [None, None]
    assert stated.to_json() == {
        "wall_force": nothing, "push": nothing, "tip_mm": nothing, "measured_on": "not measured",
    }  # fmt: skip


@pytest.mark.parametrize("mesentery", [False, True])
@pytest.mark.parametrize("wall", ["prism", "coacd"])
def test_real_colons_and_every_kind_of_pieces_have_an_error(mesentery, wall):
    stated = stated_error(SceneOptions(wall_law="pieces", mesentery=mesentery), "real", wall=wall)
    assert "real and grown colons, scopes adult and paediatric" in stated.measured_on


def test_a_wall_law_has_an_error_of_its_own():
    pieces = stated_error(SceneOptions(wall_law="pieces"), "grown", wall="prism")
    table = stated_error(MEASURED, "grown")
    assert None not in table.wall_force and table.wall_force != pieces.wall_force


def test_every_entry_spans_ten_colons_and_names_its_source():
    entries = load_measured(asset("accuracy.toml"))
    keys = [(each.wall_law, each.wall, each.mesentery, each.preset, each.colon) for each in entries]
    assert len(set(keys)) == len(keys)
    for entry in entries:
        assert entry.colons >= LEAST_COLONS
        assert "haustra bench" in entry.error.measured_on


ENTRY = """
[[measured]]
wall_law = "pieces"
wall = "prism"
mesentery = false
preset = "balanced"
colon = "grown"
colons = 10
wall_force = [0.092, 0.95]
push = [0.027, 0.46]
tip_mm = [1.1, 3.7]
source = "a test"
"""


@pytest.mark.parametrize(
    ("before", "after"), [("colons = 10", "colons = 9"), ("[0.092, 0.95]", "[0.95, 0.092]"), ("push", "pull")]
)
def test_a_range_over_too_few_colons_or_none_is_refused(tmp_path, before, after):
    (tmp_path / "a.toml").write_text(ENTRY, encoding="utf-8")
    assert len(load_measured(tmp_path / "a.toml")) == 1
    (tmp_path / "a.toml").write_text(ENTRY.replace(before, after), encoding="utf-8")
    with pytest.raises(HaustraError, match=r"a\.toml"):
        load_measured(tmp_path / "a.toml")


def test_imported_colons_are_real():
    assert kind_of(straight_tube()) == "real"
