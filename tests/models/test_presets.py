"""Presets change how a scene is computed, never what is in it, and say how far they are off."""

from dataclasses import replace

import pytest

from haustra.errors import InvalidOptionError
from haustra.models.presets import CUSTOM, MODELLING, PRESETS, error_class, find_preset, preset_of
from haustra.models.scene import SceneOptions


def test_the_defaults_are_balanced():
    assert PRESETS["balanced"].apply() == SceneOptions()
    assert preset_of(SceneOptions()) == "balanced"


@pytest.mark.parametrize("name", PRESETS)
def test_what_is_in_the_scene_stays(name):
    asked = SceneOptions(friction=0.3, wall_stiffness=900.0, push_limit=20.0, gravity=(0.0, 0.0, -9.81), timestep=0.001)
    chosen = find_preset(name).apply(asked)
    assert set(PRESETS[name].changes) <= set(MODELLING)
    assert replace(chosen, **{entry: getattr(asked, entry) for entry in MODELLING}) == asked
    assert preset_of(chosen) == name


def test_a_changed_step_is_no_preset_and_claims_no_error():
    stated = error_class(replace(SceneOptions(), timestep=0.004))
    assert stated["preset"] == CUSTOM
    assert stated["preset_tip_error_mm"] is None


def test_an_unknown_preset_is_refused_by_name():
    with pytest.raises(InvalidOptionError, match="Known: fast, balanced, accurate"):
        find_preset("fats")


def test_errors_and_speed_are_measured_and_ordered():
    measured = {name: preset.measured() for name, preset in PRESETS.items()}
    for found in measured.values():
        assert set(found) == {"tip_error", "push_error", "wall_force_error", "real_time_factor"}
        assert all("haustra bench accuracy" in each.source for each in found.values())
    errors = [measured[name]["tip_error"].value for name in ("fast", "balanced", "accurate")]
    speeds = [measured[name]["real_time_factor"].value for name in ("fast", "balanced", "accurate")]
    assert errors == sorted(errors, reverse=True)
    assert speeds == sorted(speeds, reverse=True)
