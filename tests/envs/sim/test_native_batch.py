"""Many scopes on threads: they move as one scope does, each in its own colon, whatever becomes of the others."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.load import load_backend
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import Centreline, Surface
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import Tables, lumen_table, stack
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube

DESIGN = named_design("adult")
OPTIONS = {"insertion_limit": 0.3, "shaft_cell": 0.0625, "bending_cell": 0.034, "twist_hinges": 2}
PULLS = np.array([12.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def bend() -> tuple[Scene, Tables]:
    colon = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.2, 0.0)]), name="bend")
    scene = build_scene(
        colon, None, DESIGN, SceneOptions(wall_law="table", softening=False, **OPTIONS), show_lumen=False
    )
    return scene, lumen_table(colon, device_radius=DESIGN.diameter / 2).seen_from(*entry_of(colon))


def conditions(worlds: int, friction: float = 0.1) -> Conditions:
    return Conditions(np.full(worlds, friction), np.full(worlds, 1500.0), np.ones(worlds))


def begin(bend: tuple[Scene, Tables], worlds: int, threads: int = 1, friction: float = 0.1) -> NativeBackend:
    scene, table = bend
    batch = NativeBackend(scene, stack([table]), worlds=worlds, threads=threads)
    batch.reset(np.arange(worlds), np.zeros(worlds, int), conditions(worlds, friction))
    return batch


def inputs(rates: np.ndarray, pulls: np.ndarray = PULLS) -> Controls:
    return Controls(rates, np.zeros(len(rates)), np.tile(pulls, (len(rates), 1)))


def test_a_scope_moves_as_it_does_against_the_surface_itself(bend):
    scene, _ = bend
    planes = build_scene(scene.colon, None, DESIGN, SceneOptions(wall_law="planes", **OPTIONS), show_lumen=False)
    single, batch = NativeEngine(planes), begin(bend, 1)
    apart, forces = [], []
    for _ in range(80):
        single.step(Controls(0.06, 0.0, PULLS), 8)
        assert batch.step(inputs(np.array([0.06])), 8).all()
        alone, seen = single.read(), batch.read()
        apart.append(np.linalg.norm((alone.tip - scene.entry) @ scene_axes(scene) - seen.tip[0]))
        forces.append([alone.link_forces.sum(), seen.link_forces.sum()])
    assert batch.read().tip_arc[0] > 0.17
    assert max(apart) < 0.003  # one plane a sphere instead of two, linear springs, a table, positions one step old
    mean = np.mean(forces, axis=0)
    assert mean[1] == pytest.approx(mean[0], rel=0.1)


def test_the_tips_arc_length_is_of_the_tip_and_not_of_the_sphere_behind_it():
    tube, options = straight_tube(), SceneOptions(wall_law="table", softening=False, **OPTIONS)
    scene = build_scene(tube, None, DESIGN, options, show_lumen=False)
    table = lumen_table(tube, device_radius=DESIGN.diameter / 2).seen_from(*entry_of(tube))
    batch = begin((scene, table), 1)
    for _ in range(40):
        batch.step(inputs(np.array([0.04])), 8)
    seen = batch.read()
    assert seen.bend[0, 0] > 0.4, "the tip looks aside"
    assert seen.tip_arc[0] == pytest.approx(seen.tip[0, 2], abs=2e-4)


def scene_axes(scene: Scene) -> np.ndarray:
    return entry_of(scene.colon)[1]


def test_forces_are_those_of_the_contacts(bend):
    batch = begin(bend, 1)
    for _ in range(60):
        batch.step(inputs(np.array([0.06])), 8)
    batch.step(inputs(np.array([0.0])), 400)  # at rest, since what is seen is K (d + tau d') of the step's beginning
    model, data = batch.world_data(0)
    batch.step(inputs(np.array([0.0])), 1)
    mujoco.mj_forward(model, data)
    # The planes that the step used are those of its beginning.
    model, after = batch.world_data(0)
    data.mocap_pos[:], data.mocap_quat[:] = after.mocap_pos, after.mocap_quat
    mujoco.mj_forward(model, data)
    normal = data.efc_force[data.contact.efc_address]
    seen = batch.read().link_forces.sum()
    assert seen > 1
    assert normal.sum() == pytest.approx(seen, rel=0.01)  # spheres of one link add up as vectors


def test_worlds_do_not_depend_on_threads_nor_on_their_neighbours(bend):
    rates = np.array([0.02, 0.06, 0.04])
    together, threaded, alone = begin(bend, 3), begin(bend, 3, threads=2), begin(bend, 1)
    for _ in range(30):
        together.step(inputs(rates), 8)
        threaded.step(inputs(rates), 8)
        alone.step(inputs(rates[1:2]), 8)
    assert np.array_equal(together.read().tip, threaded.read().tip)
    assert np.array_equal(together.read().tip[1], alone.read().tip[0])
    threaded.close()


def test_a_world_that_diverges_ends_alone(bend):
    batch, calm = begin(bend, 2), begin(bend, 2)
    for step in range(20):
        if step == 10:
            batch._shards[0]._qvel[0, 5] = np.nan
        healthy = batch.step(inputs(np.array([0.05, 0.05])), 4)
        calm.step(inputs(np.array([0.05, 0.05])), 4)
        assert healthy.tolist() == [step < 10, True]
    assert np.array_equal(batch.read().tip[1], calm.read().tip[1])
    assert np.isfinite(batch.read().tip).all()
    batch.reset(np.array([0]), np.array([0]), conditions(1))
    assert batch.step(inputs(np.array([0.05, 0.05])), 4).all()


def test_a_world_begins_again_as_new(bend):
    batch, new = begin(bend, 2), begin(bend, 2)
    for _ in range(20):
        batch.step(inputs(np.array([0.05, 0.05])), 4)
    batch.reset(np.array([1]), np.array([0]), conditions(1))
    for _ in range(20):
        batch.step(inputs(np.array([0.05, 0.05])), 4)
        new.step(inputs(np.array([0.05, 0.05])), 4)
    assert np.array_equal(batch.read().tip[1], new.read().tip[1])


def test_friction_stiffness_and_shaft_are_those_of_each_world(bend):
    batch = begin(bend, 4)
    differing = Conditions(
        np.array([0.0, 0.3, 0.1, 0.1]), np.array([1500.0, 1500.0, 800.0, 1500.0]), np.array([1.0, 1.0, 1.0, 2.0])
    )
    batch.reset(np.arange(4), np.zeros(4, int), differing)
    push = []
    for _ in range(80):
        batch.step(inputs(np.full(4, 0.06)), 8)
        push.append(batch.read().push_force)
    smooth, rough, _, stiff = np.mean(push[40:], axis=0)
    assert rough > smooth
    assert stiff > smooth
    model = batch.world_data(3)[0]
    assert model.jnt_stiffness.ravel()[2] == pytest.approx(2 * batch.model.jnt_stiffness.ravel()[2])


def test_scenes_with_another_wall_are_refused(bend):
    scene, table = bend
    planes = build_scene(scene.colon, None, DESIGN, SceneOptions(wall_law="planes", **OPTIONS), show_lumen=False)
    with pytest.raises(UnsupportedSceneError, match="wall_law"):
        NativeBackend(planes, stack([table]), worlds=1)


@pytest.mark.parametrize("backend", ["native", "warp"])
def test_a_stiffness_that_mujoco_would_clamp_is_refused_in_any_world(bend, backend):
    """Impedances beyond its range change a contact's stiffness in silence."""
    if backend == "warp":
        pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    batch = load_backend(backend, bend[0], stack([bend[1]]), worlds=2)
    for stiffness in (1e-4, 1e8):
        own = Conditions(np.full(2, 0.1), np.array([1500.0, stiffness]), np.ones(2))
        with pytest.raises(InvalidOptionError, match="outside what MuJoCo can honour"):
            batch.reset(np.arange(2), np.zeros(2, int), own)


def test_a_worlds_contacts_have_the_law_of_a_scenes(bend):
    batch = begin(bend, 1)
    model = batch.world_data(0)[0]
    for name in ("pair_solref", "pair_solreffriction", "pair_solimp", "pair_friction"):
        assert np.allclose(getattr(model, name), getattr(batch.model, name), rtol=1e-12), name


def test_worn_wires_lose_pull_as_in_a_single_scope():
    """Capstan and hysteresis: a worn scope bends as much less in a batch as it does alone (`arriving_pulls`).

    Its shaft follows a bend of the tube; eased by less than what friction holds, its tip stays bent.
    """
    colon = swept_colon(winding([(0.08, 0.0), (0.12, 1.6), (0.02, 0.0)]), name="bend")
    table = lumen_table(colon, device_radius=DESIGN.diameter / 2).seen_from(*entry_of(colon))
    bent = {}
    for wires in ("adult", "adult-worn"):
        design = replace(DESIGN, wires=replace(named_design(wires).wires))
        scene = build_scene(
            colon, None, design, SceneOptions(wall_law="table", softening=False, **OPTIONS), show_lumen=False
        )
        single, batch = NativeEngine(scene), begin((scene, table), 1)
        rows = []
        for step in range(80):
            pulls = PULLS if step < 50 else 0.8 * PULLS
            single.step(Controls(0.04 if step < 50 else 0.0, 0.0, pulls), 8)
            batch.step(inputs(np.array([0.04 if step < 50 else 0.0]), pulls), 8)
            rows.append((single.data.ctrl[single._pulls[0]], batch.world_data(0)[1].ctrl[single._pulls[0]]))
        bent[wires] = np.array(rows)
    np.testing.assert_allclose(bent["adult"], np.tile(np.where(np.arange(80) < 50, 12.0, 9.6)[:, None], 2))
    alone, many = bent["adult-worn"].T
    assert alone[40] < 0.9 * PULLS[0]
    assert alone[-1] > 0.95 * alone[49]
    np.testing.assert_allclose(many[10:], alone[10:], rtol=0.01)


@pytest.mark.parametrize(("backend", "within"), [("native", 1e-5), ("linear", 5e-5), ("warp", 5e-5)])
def test_a_free_scope_sags_the_same_in_a_colon_that_enters_another_way(backend, within):
    """Gravity is given in the colon's frame; worlds are stepped in the frame of their entry.

    MuJoCo's threads compute in double precision, the others in single.
    """
    if backend == "warp":
        pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    straight = widened(straight_tube(0.5), 3.0)
    turn = Rotation.from_euler("xyz", [70.0, 20.0, 40.0], degrees=True).as_matrix()
    turned = moved(straight, turn)
    options = SceneOptions(wall_law="table", softening=False, gravity=(0.0, -9.81, 0.0), start_depth=0.15, **OPTIONS)
    scene = build_scene(straight, None, DESIGN, options, show_lumen=False)
    tables = [
        lumen_table(colon, device_radius=DESIGN.diameter / 2).seen_from(*entry_of(colon))
        for colon in (straight, turned)
    ]
    batch = load_backend(backend, scene, stack(tables), worlds=2)
    batch.reset(np.arange(2), np.arange(2), conditions(2))
    for _ in range(20):
        assert batch.step(inputs(np.zeros(2), np.zeros(4)), 10).all()
    tips = batch.read().tip
    for world, colon in enumerate((straight, turned)):
        alone = NativeEngine(build_scene(colon, None, DESIGN, replace(options, wall_law="planes"), show_lumen=False))
        alone.step(Controls(0.0, 0.0), 200)
        tip = (alone.read().tip - alone.scene.entry) @ entry_of(colon)[1]
        assert np.linalg.norm(tips[world] - tip) < within
    assert np.linalg.norm(tips[0] - tips[1]) > 0.003


def widened(colon, factor):
    lumen = Surface(colon.lumen.vertices * [factor, factor, 1.0], colon.lumen.faces)
    return replace(colon, lumen=lumen, radius=factor * colon.radius)


def moved(colon, turn):
    line = colon.centreline
    return replace(
        colon,
        lumen=Surface(colon.lumen.vertices @ turn.T, colon.lumen.faces),
        centreline=Centreline(line.points @ turn.T, line.arc, np.einsum("ij,sjk->sik", turn, line.frames)),
    )
