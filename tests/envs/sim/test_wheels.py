"""Steering by wheels: travel takes up slack, stretches the wire and bends the section; what is lost on the way shows.

A wire of compliance c that has been taken up by u pulls with T = (u - slack - r theta) / c, of which p T arrives; a
section of stiffness k = EI / l then bends by theta = p r T / k, so theta = p r (u - slack) / (c k + p r^2).
"""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidDesignError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.provenance import Provenance
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.ring_wall import ring_wall
from tests.tube_colon import straight_tube, wedge_wall

ADULT = named_design("adult")
RADIUS, COMPLIANCE = ADULT.wires.routing_radius, ADULT.wires.compliance
STIFFNESS = ADULT.flexural_rigidity(ADULT.bending) / ADULT.bending.length


def engine(**wires) -> NativeEngine:
    """A scope whose bending section, still in front of the entry, is free of walls and of locks."""
    design = replace(ADULT, wires=replace(ADULT.wires, **wires))
    options = SceneOptions(insertion_limit=0.35, start_depth=0.25)
    run = NativeEngine(build_scene(straight_tube(), wedge_wall(), design, options, show_lumen=False))
    run.model.geom_conaffinity[:] = 0
    return run


def turn(run: NativeEngine, start: float, goal: float, *, speed: float = 0.002) -> np.ndarray:
    """Turn the wheel 'up' slowly; travel [m] and bend [rad] on the way."""
    step = run.scene.options.timestep
    path = np.linspace(start, goal, round(abs(goal - start) / speed / step) + 1)[1:]
    seen = []
    for travel in (*path, *[goal] * 100):
        assert run.step(Controls(0.0, 0.0, wheels=np.array([travel, 0.0])), 1)
        seen.append((travel, run.read().bend[0]))
    return np.array(seen)


def bend_by_theory(travel: float, *, slack: float = 0.0, part: float = 1.0) -> float:
    return part * RADIUS * (travel - slack) / (COMPLIANCE * STIFFNESS + part * RADIUS**2)


@pytest.mark.parametrize("slack", [0.0, 0.002])
def test_a_wheel_bends_the_tip_once_the_slack_is_out(slack, compare):
    run = engine(slack=slack)
    seen = turn(run, 0.0, 0.008)
    assert np.abs(seen[seen[:, 0] < slack, 1]).max(initial=0.0) < 1e-6
    what = f"wheel turned by 8 mm of wire, {slack * 1e3:.0f} mm of slack: bend [rad]"
    compare(what, seen[-1, 1], bend_by_theory(0.008, slack=slack), within=0.01)
    pull = bend_by_theory(0.008, slack=slack) * STIFFNESS / RADIUS
    assert run.read().pulls == pytest.approx([pull, 0, 0, 0], abs=0.02 * pull)


def test_slack_leaves_a_dead_band_about_the_middle(compare):
    """From up to down the wheel turns through twice the slack without moving the tip."""
    run = engine(slack=0.002)
    turn(run, 0.0, 0.006)
    seen = turn(run, 0.006, -0.006)
    idle = seen[np.abs(seen[:, 1]) < 0.01 * np.abs(seen[:, 1]).max(), 0]
    compare("wheel turned back: dead band [m of wire]", np.ptp(idle), 0.004, within=0.05)
    assert seen[-1, 1] == pytest.approx(-bend_by_theory(0.006, slack=0.002), rel=0.02)


def test_friction_holds_the_bend_while_the_wheel_is_eased(compare):
    """The pull must fall by the square of the part that arrives before the tip follows."""
    part = 0.7
    run = engine(hysteresis=1 - part)
    bent = turn(run, 0.0, 0.008, speed=0.0005)[-1, 1]
    compare("wheel, 30 % of the pull lost: bend [rad]", bent, bend_by_theory(0.008, part=part), within=0.01)
    seen = turn(run, 0.008, 0.004, speed=0.0005)
    still = seen[seen[:, 1] > 0.995 * bent, 0].min()
    pull = STIFFNESS * bent / RADIUS
    compare(
        "wheel eased: travel that the tip does not follow [m]",
        0.008 - still,
        COMPLIANCE * pull * (1 / part - part),
        within=0.05,
    )


def test_a_used_scope_follows_its_wheels_less_in_a_run():
    """Round a bend, the same driver turns the same wheels: a worn scope's tip is further from what it steers for."""
    colon = swept_colon(winding([(0.1, 0.0), (0.12, 1.5)]), name="bent tube")
    wall = ring_wall(colon, sectors=24, thickness=0.02)
    gaps = []
    for name in ("adult", "adult-worn"):
        scene = build_scene(colon, wall, named_design(name), show_lumen=False)
        run = run_insertion(scene, seconds=4, settings=FollowerSettings(steer="wheels"))
        assert run.settings.steer == "wheels"
        gaps.append(float(str(score(scene, run, Provenance(inputs={}, configuration={}))["steering_gap_mean_deg"])))
    assert gaps[1] > gaps[0] + 5


def test_wheels_need_wires_that_stretch():
    with pytest.raises(InvalidDesignError, match="do not stretch"):
        engine(compliance=0.0).step(Controls(0.0, 0.0, wheels=np.zeros(2)), 1)
    with pytest.raises(InvalidDesignError, match="at least"):
        engine(compliance=1e-6).step(Controls(0.0, 0.0, wheels=np.zeros(2)), 1)
