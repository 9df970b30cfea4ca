"""Presets change how a scene is computed, never what is in it, and say how far they are off."""

from dataclasses import replace

import pytest

from haustra.errors import InvalidOptionError
from haustra.models.presets import CUSTOM, MODELLING, PRESETS, find_preset, preset_of
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


@pytest.mark.parametrize("name", PRESETS)
def test_joints_are_cheap_against_the_table(name):
    """In linear time more joints cost little: every preset has more of them there, and keeps its name."""
    asked = SceneOptions(friction=0.3, mesentery=False)
    chosen, usual = (find_preset(name).apply(asked, law=law) for law in ("table", "pieces"))
    assert chosen.wall_law == "table" and chosen.friction == 0.3
    assert chosen.shaft_cell < usual.shaft_cell or name == "accurate"
    assert chosen.bending_cell < usual.bending_cell or chosen.timestep < usual.timestep
    assert preset_of(replace(chosen, mesentery=True)) == preset_of(usual) == name


def test_a_changed_step_is_no_preset():
    assert preset_of(replace(SceneOptions(), timestep=0.004)) == CUSTOM


def test_an_unknown_preset_is_refused_by_name():
    with pytest.raises(InvalidOptionError, match="Known: fast, balanced, accurate"):
        find_preset("fats")
