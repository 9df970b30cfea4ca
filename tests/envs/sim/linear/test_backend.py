"""Linear time: the dense step to rounding, worlds that keep to themselves, runs that repeat to the bit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.scope_reading import read_scope, stack_scopes
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.models.wall.sections import SHORTEST
from haustra.scripts.bench.linear import SIZES, bank_of, conditions, driven, gather, largest_difference, miss, resized
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@cache
def _bank(mesentery=False):
    return bank_of(40, colons=1, mesentery=mesentery)


@pytest.fixture
def bank():
    return _bank()


@pytest.mark.parametrize("mesentery", [False, True])
def test_a_step_is_the_dense_step(mesentery):
    """The bar of 1e-9 is for any step; rounding leaves 1e-12. `haustra bench linear` asks 200 states of it."""
    assert largest_difference(_bank(mesentery), worlds=10, instants=3) < 1e-10


def test_a_step_is_the_dense_step_where_folds_lie_against_each_other():
    bank = _bank(mesentery=True)
    backend, _ = driven(bank, 5, seconds=5.0, real=np.float64)
    gather(backend)
    state, own = backend.state(), bank.tables.mesentery
    assert own is not None and state.displacement is not None
    lengths = np.linalg.norm(np.diff(own.nodes + state.displacement.pose[..., :3], axis=1), axis=-1)
    assert ((lengths / own.lengths).min(axis=1) < SHORTEST).mean() > 0.5 and (state.normal > 0).any(axis=1).all()
    assert largest_difference(bank, worlds=10, instants=3, before_step=gather) < 1e-9


def test_a_step_is_the_dense_step_where_a_shaft_has_missed_a_loop():
    """Nodes between two spheres are drawn to the shaft, which bears as much, to rounding; in lanes and alone."""
    bank = _bank(mesentery=True)
    backend, _ = driven(bank, 5, seconds=5.0, real=np.float64)
    miss(backend)
    state, own = backend.state(), bank.tables.mesentery
    assert own is not None and state.displacement is not None
    for worlds in (10, 1):
        assert largest_difference(bank, worlds=worlds, instants=3, before_step=miss) < 1e-9
    apart = np.diff(state.arcs[:, :-1], axis=1).max(axis=1)
    assert (apart > 0.07).all()


def test_a_tip_is_looked_up_no_further_beyond_the_shaft_than_folds_can_be_packed():
    """In lanes and alone: a tip that is taken for one in the other leg of a bend would else stay there."""
    colon = swept_colon(winding([(0.2, 0.0), (0.08, np.pi), (0.2, 0.0)]), name="hairpin")
    options = SceneOptions(wall_law="table", softening=False, mesentery=True, insertion_limit=0.3, start_depth=0.15)
    design = named_design("adult")
    scene = build_scene(colon, None, design, options, show_lumen=False)
    table = lumen_table(colon, device_radius=design.diameter / 2, with_mesentery=True).seen_from(*entry_of(colon))
    for worlds in (10, 1):
        backend = LinearBackend(scene, stack([table]), worlds=worlds)
        still = Controls(np.zeros(worlds), np.zeros(worlds), np.zeros((worlds, 4)))
        assert backend.step(still, 4).all()
        known = backend.read().tip_arc
        for world in range(worlds):
            now = backend.snapshot(world)
            tip = 2 * backend.positions().shape[1] + len(now.arcs)
            assert now.state[tip] == pytest.approx(known[world])
            now.state[tip] = 0.48 - known[world]  # beside it in the other leg
            backend.restore(world, now)
        assert backend.step(still, 4).all()
        assert backend.read().tip_arc == pytest.approx(known, abs=2e-3)


def test_single_precision_stays_with_double(bank):
    backends = [driven(bank, 8, seconds=4.0, real=real)[0] for real in (np.float32, np.float64)]
    single, double = (backend.read() for backend in backends)
    np.testing.assert_allclose(single.insertion, double.insertion, atol=5e-4)
    assert double.link_forces.sum() > 1
    assert single.link_forces.sum() == pytest.approx(double.link_forces.sum(), rel=0.02)


@pytest.mark.parametrize("where", ["push_rate", "pulls"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_world_that_breaks_harms_no_other_and_is_left_as_it_was(bank, where, value):
    count = 11
    backend, hands = driven(bank, count, seconds=2.0)
    twin, same = driven(bank, count, seconds=2.0)
    inputs = hands.next()
    assert same.next().push_rate.shape == inputs.push_rate.shape
    before = backend.state()
    injected = inputs._replace(**{where: np.array(getattr(inputs, where))})
    getattr(injected, where)[3] = value
    assert backend.step(injected, 4).tolist() == [world != 3 for world in range(count)]
    assert twin.step(inputs, 4).all()
    after, known = backend.state(), twin.state()
    others = np.arange(count) != 3
    for name in ("qpos", "qvel", "normal", "arcs", "hand", "pulls", "time"):
        np.testing.assert_array_equal(getattr(after, name)[others], getattr(known, name)[others])
        np.testing.assert_array_equal(getattr(after, name)[3], getattr(before, name)[3])
    assert np.isfinite(backend.read().tip).all()
    backend.reset(np.array([3]), np.array([0]), conditions(bank, count).of(np.array([3])))
    assert backend.step(inputs, 4).all()


@pytest.mark.parametrize("mesentery", [False, True])
@pytest.mark.parametrize(("worlds", "as_on_a_gpu"), [(11, False), (1, False), (1, True)])
def test_a_world_that_breaks_on_its_way_is_left_at_its_last_sound_step(mesentery, worlds, as_on_a_gpu, monkeypatch):
    """A hand without a limit that runs away tears one scope along; others, and the steps before, are none the wiser.

    On a GPU each world has a program of its own, one number wide, in which nothing of it stands side by side.
    """
    if as_on_a_gpu:
        monkeypatch.setattr("haustra.envs.sim.linear.backend.lanes_of", lambda real: 1)
    backends = [driven(_bank(mesentery), worlds, seconds=0.5)[0] for _ in range(2)]
    one, last = np.ones(worlds), worlds - 1
    inputs = Controls(0.01 * one, 0.0 * one, np.zeros((worlds, 4)))
    inputs.push_rate[last] = 1e5
    for backend in backends:
        backend.give("push_limit", np.where(inputs.push_rate > 1, 1e12, 40.0))
    backend, twin = backends
    begun = backend.state().time[last]
    assert backend.step(inputs, 40).tolist() == [world != last for world in range(worlds)]
    after = backend.state()
    sound = round((after.time[last] - begun) / backend.scene.options.timestep)
    assert 0 < sound < 40
    assert twin.step(inputs, sound).all()
    known = twin.state()
    for name in ("qpos", "qvel", "normal", "hand", "pulls", "time"):
        np.testing.assert_array_equal(getattr(after, name)[last], getattr(known, name)[last])
    if after.displacement is not None and known.displacement is not None:
        np.testing.assert_array_equal(after.displacement.speed[last], known.displacement.speed[last])
        np.testing.assert_array_equal(after.displacement.pose[last, :, :3], known.displacement.pose[last, :, :3])
    twin.reset(np.array([last]), np.array([0]), conditions(_bank(mesentery), worlds).of(np.array([last])))
    twin.give("push_limit", 40.0)
    assert twin.step(inputs._replace(push_rate=0.01 * one), 40 - sound).all()
    others = np.arange(worlds) != last
    np.testing.assert_array_equal(after.qpos[others], twin.state().qpos[others])


def test_threads_and_lanes_do_not_change_a_bit(bank):
    one, two = (driven(bank, 21, seconds=1.0, threads=threads)[0].state() for threads in (1, 2))
    for name in ("qpos", "qvel", "normal"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


@pytest.mark.parametrize("as_on_a_gpu", [False, True])
@pytest.mark.parametrize("mesentery", [False, True])
def test_a_scope_alone_goes_as_among_others(mesentery, as_on_a_gpu, monkeypatch):
    """Nodes and spheres of a scope that is alone stand in the lanes where else its neighbours do.

    Or it has a program one number wide, whose steps, five a launch here, write the chain by turns in two places.
    """
    if as_on_a_gpu:
        monkeypatch.setattr("haustra.envs.sim.linear.backend.lanes_of", lambda real: 1)
    own = _bank(mesentery)
    alone, among = (driven(own, count, seconds=0.0, real=np.float64)[0] for count in (1, 5))
    among.reset(np.arange(5), np.zeros(5, int), conditions(own, 1).of(np.zeros(5, int)))
    for backend in (alone, among):
        count = backend.worlds
        for _ in range(40):
            pulls = np.tile([9.0, 3.0, 0.0, 0.0], (count, 1))
            assert backend.step(Controls(np.full(count, 0.05), np.zeros(count), pulls), 5).all()
    states = [backend.state() for backend in (alone, among)]
    assert (states[0].normal > 0).any()
    for name in ("qpos", "qvel", "arcs", "normal"):
        one, many = (getattr(state, name) for state in states)
        np.testing.assert_allclose(one[0], many[4], atol=1e-10)
    one, many = (backend.read() for backend in (alone, among))
    for name in ("tip", "tip_frame", "tip_force", "deepest", "link_forces", "coils"):
        np.testing.assert_allclose(getattr(one, name)[0], getattr(many, name)[4], atol=1e-7)
    assert one.link_forces.max() > 0.01
    first, last = (state.displacement for state in states)
    if first is not None and last is not None:
        np.testing.assert_allclose(first.speed[0], last.speed[4], atol=1e-10)
        np.testing.assert_allclose(first.pose[0, :, :3], last.pose[4, :, :3], atol=1e-12)
        assert np.abs(first.pose[0, :, :3]).max() > 1e-4
    assert (first is not None) == mesentery


def test_designs_that_differ_by_world_go_as_each_does_alone(bank):
    adult = named_design("adult")
    limp = replace(adult, bending=replace(adult.bending, flexural_rigidity=0.5 * adult.bending.flexural_rigidity))
    scenes = [resized(replace(bank, scene=replace(bank.scene, design=each)), 40).scene for each in (adult, limp)]
    own = conditions(bank, 2)
    each = [LinearBackend(scene, bank.tables, worlds=2) for scene in scenes]
    both = LinearBackend(scenes[0], bank.tables, worlds=2, scopes=stack_scopes([read_scope(scene) for scene in scenes]))
    inputs = Controls(np.full(2, 0.05), np.zeros(2), np.tile([9.0, 3.0, 0.0, 0.0], (2, 1)))
    for backend in (*each, both):
        backend.reset(np.arange(2), np.zeros(2, int), own)
        for _ in range(20):
            assert backend.step(inputs, 20).all()
    tips = np.stack([each[world].read().tip[world] for world in range(2)])
    np.testing.assert_allclose(both.read().tip, tips, atol=1e-5)
    assert np.linalg.norm(each[0].read().tip[1] - tips[1]) > 1e-4
    with pytest.raises(InvalidOptionError, match="one design a world, 3"):
        LinearBackend(scenes[0], bank.tables, worlds=3, scopes=stack_scopes([read_scope(scene) for scene in scenes]))


@pytest.mark.parametrize("dofs", SIZES)
def test_sizes_are_what_they_say_and_drawn_as_they_are(bank, dofs):
    sized = resized(bank, dofs)
    model, data = LinearBackend(sized.scene, sized.tables, worlds=1).world_data(0)
    assert model.nv == pytest.approx(dofs, rel=0.1)
    assert data.qpos.shape == (model.nv,)


@pytest.mark.parametrize("worlds", [1, 3])
def test_a_ring_that_is_turned_on_command_stiffens_as_a_design_says(bank, worlds):
    """Sections stiffen each by its own factor; a scope whose ring was turned before goes the same way."""
    soft, uneven = named_design("adult"), ((1.28, 2.0), (0.285, 1.5))
    (shaft,) = soft.shaft
    soft = replace(soft, shaft=tuple(replace(shaft, length=length, stiffening=ring) for length, ring in uneven))
    inputs = Controls(np.full(worlds, 0.05), np.zeros(worlds), np.tile([9.0, 3.0, 0.0, 0.0], (worlds, 1)))
    found = {}
    for design, turned in ((soft, 0.0), (soft, 1.0), (replace(soft, variable_stiffness=1.0), 0.0)):
        scene = resized(replace(bank, scene=replace(bank.scene, design=design)), 40).scene
        backend = LinearBackend(scene, bank.tables, worlds=worlds, real=np.float64)
        backend.reset(np.arange(worlds), np.zeros(worlds, int), conditions(bank, worlds))
        backend.give("ring", turned)
        for _ in range(40):
            assert backend.step(inputs, 20).all()
        found[design.variable_stiffness, turned] = backend.read().tip
    np.testing.assert_allclose(found[0.0, 1.0], found[1.0, 0.0], atol=1e-8)
    assert np.linalg.norm(found[0.0, 1.0] - found[0.0, 0.0], axis=-1).min() > 1e-4
