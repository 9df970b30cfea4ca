"""Looping of a run: excess length, writhe, names, and what pulling back shortens."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import LumenFollower
from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.measure.looping import looping, shortening
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.runs.measure.scores import score
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.provenance import Provenance
from tests.bent_colon import bent_colon
from tests.tube_colon import straight_tube, wedge_wall


def test_a_straight_scope_has_no_loop():
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"))
    run = run_insertion(scene, seconds=8)
    found = looping(scene, run)
    assert abs(found.excess) < 0.005
    assert found.writhe_peak < 0.01
    assert found.at_end == ()
    scores = score(scene, run, Provenance(inputs={}, configuration={}))
    assert scores["loops_at_end"] == "none"
    assert (
        scores["loop_alpha_s"] == scores["loop_reversed_alpha_s"] == scores["loop_N_s"] == scores["loop_gamma_s"] == 0
    )


def test_a_coiled_scope_is_named_and_its_writhe_counted():
    """Joint angles of a helix about y put an alpha loop into the records; mirrored, a reversed one."""
    scene = build_scene(straight_tube(1.0), wedge_wall(1.0), named_design("adult"))
    run = run_insertion(scene, seconds=0.1)
    model = scene.compile()
    for handed, name in ((-1.0, "alpha"), (1.0, "reversed alpha")):
        coil = np.zeros_like(run.trajectory.qpos)
        for joint in range(model.njnt):
            number = int(model.joint(joint).name[-3:]) if "bend" in model.joint(joint).name else 0
            if 6 <= number < 17:  # one turn about y, leaning more and more
                lean = handed * 0.05 * (number - 6)
                coil[:, joint] = 2 * np.pi / 11 * model.jnt_axis[joint, :2] @ [np.sin(lean), np.cos(lean)]
        still = {"insertion": np.full(len(coil), 0.9), "tip_arc": np.full(len(coil), 0.5)}
        coiled = replace(run, trajectory=replace(run.trajectory, qpos=coil, **still))
        found = looping(scene, coiled)
        assert [loop.kind.value for loop in found.at_end][:1] == [name]
        assert found.seconds[name] > 0
        assert found.writhe_peak > 0.3
        assert found.excess == pytest.approx(0.4)


def test_shortening_counts_only_while_the_tip_stays():
    insertion = np.array([0.5, 0.6, 0.58, 0.55, 0.50, 0.45])
    stays = np.array([0.4, 0.5, 0.5, 0.499, 0.45, 0.4])
    assert shortening(insertion, stays) == pytest.approx(0.05)
    assert shortening(insertion, insertion) == pytest.approx(0.0, abs=1e-12)


def test_pulling_back_shortens_a_bowed_scope_while_its_tip_stays(record_property):
    """Round half a turn of 80 mm radius a pushed scope bows to the outer wall; with its tip hooked, it can be pulled in
    towards the inner one, by at most the turn times the room across, pi (40 mm - 12.8 mm) = 85 mm."""
    colon, wall = bent_colon([(0.12, 0.0), (0.25, np.pi), (0.3, 0.0)])
    scene = build_scene(colon, wall, named_design("adult"), SceneOptions(friction=0.1), show_lumen=False)
    engine = NativeEngine(scene)
    tracker = ArcTracker(colon.centreline, start=scene.options.start_depth)
    tip_links = scene.cable.tip_links
    driver = LumenFollower(colon.centreline, scene.design, tip_links=tip_links)
    seen = engine.read()
    while tracker.arc < 0.55 and seen.time < 30:
        assert engine.step(driver.act(seen, tracker.arc, 0.02), 4)
        seen = engine.read()
        tracker.update(seen.tip)
    assert tracker.arc >= 0.55
    insertion, arc, pull = [], [], []
    for _ in range(150):
        assert engine.step(Controls(-0.02, 0.0, np.array([40.0, 0.0, 0.0, 0.0])), 4)
        seen = engine.read()
        insertion.append(seen.insertion)
        arc.append(tracker.update(seen.tip))
        pull.append(-seen.push_force)
    shorter = shortening(np.array(insertion), np.array(arc))
    record_property(
        "figure", f"pull back round half a turn: shortening [m]|{shorter:.4g}|0.085|{1 - shorter / 0.085:.3g}|1"
    )
    assert 0.02 < shorter < 0.085
    assert max(pull) > 1.0
