"""Runs of devices state the error that was measured for their kind, as a range over many colons."""

import pytest

from haustra.assets import asset
from haustra.errors import HaustraError
from haustra.models.accuracy import NOT_MEASURED
from haustra.models.device_accuracy import load_device_errors, stated_device_error
from haustra.models.device_scene import device_options
from haustra.models.devices.base import load_device

ENTRY = """
[[measured]]
device = "capsule"
mesentery = true
colons = 10
wall_force = [0.01, 0.1]
tip_mm = [0.1, 2.0]
source = "a test"
"""


def test_a_kind_that_was_measured_states_its_range_and_nobody_pushes_it():
    capsule = load_device("capsule")
    stated = stated_device_error(capsule, device_options(capsule, mesentery=True), "grown")
    assert "haustra bench device-errors" in stated.measured_on and "10 grown colons, capsule" in stated.measured_on
    low, high = stated.wall_force
    assert low is not None and high is not None and 0 <= low < high
    assert stated.push == (None, None)


@pytest.mark.parametrize(
    ("changed", "colon"), [({}, "real"), ({"timestep": 0.001}, "grown"), ({"wall_law": "planes"}, "grown")]
)
def test_what_nobody_measured_is_not_stated(changed, colon):
    capsule = load_device("capsule")
    assert stated_device_error(capsule, device_options(capsule, **changed), colon) is NOT_MEASURED


@pytest.mark.parametrize(
    ("before", "after"), [("colons = 10", "colons = 9"), ("[0.01, 0.1]", "[1, 0]"), ("tip", "top")]
)
def test_a_range_over_too_few_colons_or_none_is_refused(tmp_path, before, after):
    path = tmp_path / "a.toml"
    path.write_text(ENTRY, encoding="utf-8")
    assert load_device_errors(path)["capsule", True].tip_mm == (0.1, 2.0)
    path.write_text(ENTRY.replace(before, after), encoding="utf-8")
    with pytest.raises(HaustraError, match=r"a\.toml: an entry lacks"):
        load_device_errors(path)


def test_every_entry_that_ships_names_its_source():
    found = load_device_errors(asset("device_accuracy.toml"))
    assert {kind for kind, _ in found} >= {"capsule", "inchworm", "tracked"}
    assert all("haustra bench" in error.measured_on for error in found.values())
