"""Wires as springs in linear time: the dense step to rounding, theory at rest, the native backend in motion."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.sim.linear import program
from haustra.envs.sim.linear.compile import write_kernel, write_program
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidDesignError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.provenance import Provenance
from haustra.scripts.bench.linear import bank_of, driven, largest_difference
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube, wedge_wall

_ADULT = named_design("adult")
_KINDS = {
    "new": {},
    "worn": {"friction": 0.1, "hysteresis": 0.2, "slack": 0.001},
    "nearly rigid, rubbing, strong": {"compliance": 1e-7, "hysteresis": 0.3, "pull_limit": 300.0},
}


def _design(name="adult", **wires):
    design = named_design(name)
    return replace(design, wires=replace(design.wires, **wires))


@cache
def _adults(mesentery):
    return bank_of(40, colons=1, mesentery=mesentery)


def _bank(kind="new", mesentery=False):
    bank = _adults(mesentery)
    options, design = bank.scene.options, _design(**_KINDS[kind])
    return replace(bank, scene=build_scene(bank.colons[0], None, design, options, show_lumen=False))


@pytest.mark.parametrize("wheels", [True, False])
@pytest.mark.parametrize("kind", _KINDS)
def test_a_step_is_the_dense_step(kind, wheels):
    """The bar of 1e-9 is for any step; rounding leaves 1e-11."""
    assert largest_difference(_bank(kind), worlds=20, instants=6, wheels=wheels) < 1e-10


@pytest.mark.thorough
def test_a_step_in_a_colon_that_moves_is_the_dense_step():
    assert largest_difference(_bank("worn", True), worlds=8, instants=3, wheels=True) < 1e-10


def test_programs_that_pulls_steer_hold_nothing_of_wires_as_springs(monkeypatch):
    usual = {"real": np.float32, "timestep": 0.005, "angles": 8, "one_design": True, "moving": False}
    kinds = (write_program, {"lanes": 8}), (write_kernel, {})
    steered = [write(**usual, **more, wheels=True) for write, more in kinds]
    monkeypatch.setattr(program, "SprungWires", None)
    plain = [write.__wrapped__(**usual, **more) for write, more in kinds]
    assert all(len(one) < len(other) for one, other in zip(plain, steered, strict=True))
    with pytest.raises(TypeError):
        write_program.__wrapped__(**usual, lanes=8, wheels=True)


def _scene(name, law, *, timestep=0.005, **wires):
    options = SceneOptions(insertion_limit=0.35, start_depth=0.25, wall_law=law, timestep=timestep)
    wall = wedge_wall() if law == "pieces" else None
    return build_scene(straight_tube(), wall, _design(name, **wires), options, show_lumen=False)


def _free(name="adult", **own):
    """A scope whose bending section, still in front of the entry, is free of walls and of locks."""
    backend = LinearSingle(_scene(name, "table", **own))
    backend.many.give("stiffness", 1e-9)
    return backend


def _natively(name="adult", **own):
    backend = NativeEngine(_scene(name, "pieces", **own))
    backend.model.geom_conaffinity[:] = 0
    return backend


def _turned(backend, *, seconds=2.0):
    """Bends of a scope whose wheels go to and fro, every 20 ms, and are then held for a second and a half."""
    count = round(0.02 / backend.scene.options.timestep)
    seen = []
    for time in np.arange(0, seconds + 1.5, 0.02):
        now = min(time, seconds)
        wheels = np.array([0.008 * np.sin(2.5 * now), 0.004 * np.sin(1.7 * now)])
        assert backend.step(Controls(0.0, 0.0, wheels=wheels), count)
        seen.append(backend.read().bend)
    return np.array(seen)


@pytest.mark.parametrize("slack", [0.0, 0.002])
def test_a_wheel_bends_the_tip_as_by_theory(slack, compare):
    run, wires = _free(slack=slack), _ADULT.wires
    for travel in np.linspace(0, 0.008, 100):
        assert run.step(Controls(0.0, 0.0, wheels=np.array([travel, 0.0])), 4)
    assert run.step(Controls(0.0, 0.0, wheels=np.array([0.008, 0.0])), 400)
    stiffness = _ADULT.flexural_rigidity(_ADULT.bending) / _ADULT.bending.length
    radius = wires.routing_radius
    theory = radius * (0.008 - slack) / (wires.compliance * stiffness + radius**2)
    seen = run.read()
    compare(f"linear time, 8 mm of wire, {slack * 1e3:.0f} mm of slack: bend [rad]", seen.bend[0], theory, within=0.01)
    pull = theory * stiffness / radius
    assert seen.pulls == pytest.approx([pull, 0, 0, 0], abs=0.02 * pull)


def test_wheels_turn_new_wires_as_natively(compare):
    """At rest the same; in motion MuJoCo's wires are explicit, and further from small steps than these are."""
    fine, mine, natively = _turned(_free(timestep=0.000625)), _turned(_free()), _turned(_natively())
    np.testing.assert_allclose(mine[-1], natively[-1], atol=1e-8)
    most, own = (np.abs(seen - fine).max() for seen in (natively, mine))
    compare("bend of turned wheels, native, from small steps [rad]", most, 0.0, within=0.02, scale=np.abs(fine).max())
    compare("the same, in linear time", own, 0.0, within=0.002, scale=np.abs(fine).max())


def test_wheels_turn_worn_wires_as_natively(compare):
    """Where a wire sticks depends on how it came there, so that a difference in motion is there at rest too."""
    mine, natively = _turned(_free("adult-worn")), _turned(_natively("adult-worn"))
    apart, bent = np.abs(mine - natively).max(), np.abs(natively).max()
    compare("bend of a worn scope's turned wheels, from native [rad]", apart, 0.0, within=0.03, scale=bent)


def test_wires_that_are_too_stiff_for_native_steps_are_not_here():
    run = _free(compliance=1e-7)
    with pytest.raises(InvalidDesignError, match="at least"):
        _natively(compliance=1e-7).step(Controls(0.0, 0.0, wheels=np.zeros(2)), 1)
    seen = _turned(run, seconds=1.0)
    now = np.array([0.008 * np.sin(2.5), 0.004 * np.sin(1.7)])
    np.testing.assert_allclose(seen[-1], now / _ADULT.wires.routing_radius, rtol=0.01)


def test_wires_that_do_not_stretch_are_refused():
    with pytest.raises(InvalidDesignError, match="do not stretch"):
        _free(compliance=0.0).step(Controls(0.0, 0.0, wheels=np.zeros(2)), 1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_wheel_that_is_no_number_harms_its_own_world_only(value):
    (backend, hands), (twin, _) = (driven(_bank(), 11, seconds=1.0, wheels=True) for _ in range(2))
    inputs, before = hands.next(), backend.state()
    spoilt = inputs._replace(wheels=inputs.wheels.copy())
    spoilt.wheels[3, 1] = value
    assert backend.step(spoilt, 4).tolist() == [world != 3 for world in range(11)]
    assert twin.step(inputs, 4).all()
    after, known, others = backend.state(), twin.state(), np.arange(11) != 3
    for name in ("qpos", "qvel", "normal", "pulls"):
        np.testing.assert_array_equal(getattr(after, name)[others], getattr(known, name)[others])
        np.testing.assert_array_equal(getattr(after, name)[3], getattr(before, name)[3])


def test_hands_may_pull_then_turn_wheels_then_pull():
    backend, hands = driven(_bank(), 3, seconds=0.5)
    turning = hands.next()._replace(wheels=np.full((3, 2), 0.003))
    assert backend.step(turning, 40).all()
    assert (backend.state().pulls[:, :2] > 1).all()
    assert backend.step(hands.next()._replace(pulls=np.zeros((3, 4))), 1).all()
    assert not backend.state().pulls.any()


def test_the_follower_turns_wheels_in_the_program_as_outside_it():
    """One driver, inside and outside the program, drives alike; a worn scope's tip is further from where it steers."""
    colon = swept_colon(winding([(0.1, 0.0), (0.12, 1.5)]), name="bent tube")
    settings, gaps = FollowerSettings(steer="wheels"), []
    for name in ("adult", "adult-worn"):
        scene = build_scene(colon, None, named_design(name), SceneOptions(wall_law="table"), show_lumen=False)
        within = run_linear_insertion(scene, seconds=4, settings=settings)
        outside = run_insertion(scene, seconds=4, settings=settings, backend=LinearSingle)
        np.testing.assert_allclose(within.trajectory.bend_up, outside.trajectory.bend_up, atol=0.02)
        np.testing.assert_allclose(within.trajectory.insertion, outside.trajectory.insertion, atol=2e-3)
        found = score(scene, within, Provenance(inputs={}, configuration={}))
        gaps.append(float(str(found["steering_gap_mean_deg"])))
    assert gaps[1] > gaps[0] + 5
