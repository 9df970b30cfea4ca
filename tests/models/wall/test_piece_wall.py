"""What presses on one place of a wall of pieces is met by F = K d, over joints and corners too; slabs are the wall."""

from itertools import product

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, add_wall, build_scene
from haustra.models.wall.law import WallContact, apply_contact
from haustra.models.wall.piece_wall import step_once
from haustra.models.wall.pieces.slabs import SLAB, cut_into_slabs
from haustra.models.wall.pieces.wall import Wall, WallAccuracy, WallPiece
from haustra.provenance import Provenance
from tests.tube_colon import straight_tube, wedge_wall

SPHERE, STIFFNESS = 0.0064, 1500.0
SIDE = 0.008


def _floor() -> Wall:
    """Four blocks of 8 mm that meet in a corner at the origin, their tops level with it."""
    corners = (product((0, x * SIDE), (0, y * SIDE), (0, -0.03)) for x, y in product((-1, 1), repeat=2))
    return _wall(np.array(list(each), float) for each in corners)


def _valley() -> Wall:
    """Two plates that meet at the origin in a right angle."""
    along, through = (np.array([x, 0.0, z]) * 0.03 / np.sqrt(2) for x, z in ((1, 1), (1, -1)))
    plate = np.array([a * along + b * through + [0, y, 0] for a, b, y in product((0, 1), (0, 1), (-0.03, 0.03))])
    return _wall((plate, plate * [-1, 1, 1]))


def _wall(solids) -> Wall:
    pieces = [WallPiece(corners, 0.0, SIDE) for corners in solids]
    nothing = WallAccuracy(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 0)
    return Wall("prism", tuple(pieces), nothing, Provenance(inputs={}, configuration={}), {})


def _pressed(place, load: float, step, friction: float = 0.0, wall: Wall | None = None) -> tuple[float, mujoco.MjData]:
    """How deep a sphere of 200 g comes to rest under a load [m]."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.005
    spec.option.gravity = [0, 0, 0]
    spec.option.tolerance = 1e-14
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    body = spec.worldbody.add_body(name="probe", pos=[*place, SPHERE * (np.sqrt(2) if wall else 1)])
    body.add_joint(name="z", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    size = [SPHERE, 0, 0]
    body.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, mass=0.2, contype=0, conaffinity=1)
    contact = WallContact(stiffness=STIFFNESS, damping=0.005 * STIFFNESS, friction=friction)
    apply_contact(spec, spec.compile(), ["ball"], contact, timestep=spec.option.timestep)
    add_wall(spec, wall or _floor())
    model = spec.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body("probe").id, 2] = -load
    ball = np.arange(model.ngeom) == model.geom("ball").id
    for _ in range(600):
        step(model, data, ball)
    return -float(data.qpos[0]), data


@pytest.mark.parametrize("load", [1.0, 6.0])
@pytest.mark.parametrize("place", [(0.004, 0.004), (0.0, 0.004), (0.0, 0.0), (0.001, 0.0005)])
def test_a_press_on_the_middle_a_joint_or_a_corner_of_pieces_ends_where_hooke_says(place, load) -> None:
    """Hooke: a wall of stiffness K holds a load F at F / K, wherever its pieces meet."""
    depth, data = _pressed(place, load, step_once)
    assert depth == pytest.approx(load / STIFFNESS, rel=0.01)
    force = data.efc_force[data.contact.efc_address[data.contact.efc_address >= 0]]
    assert force.sum() == pytest.approx(load, rel=0.01)


def test_two_walls_that_meet_at_an_angle_both_press() -> None:
    """In a rectangular valley each side bears F / sqrt(2) and gives way by F / (sqrt(2) K): downwards that is F / K."""
    depth, _ = _pressed((0.0, 0.0), 6.0, step_once, wall=_valley())
    assert depth == pytest.approx(6.0 / STIFFNESS, rel=0.01)


def test_counted_by_themselves_pieces_are_a_stiffer_wall() -> None:
    """Four springs in parallel are four times as stiff: what stock MuJoCo makes of a corner."""
    depth, _ = _pressed((0.0, 0.0), 6.0, lambda model, data, _: mujoco.mj_step(model, data))
    assert depth == pytest.approx(6.0 / STIFFNESS / 4, rel=0.01)


def test_where_nothing_is_left_out_a_step_is_that_of_mujoco_to_the_bit() -> None:
    away = (0.005, 0.005)
    one, mine = _pressed(away, 1.0, step_once, friction=0.3)
    other, theirs = _pressed(away, 1.0, lambda model, data, _: mujoco.mj_step(model, data), friction=0.3)
    assert one == other
    assert np.array_equal(mine.qvel, theirs.qvel) and np.array_equal(mine.efc_force, theirs.efc_force)


def test_slabs_of_a_wall_are_short_and_as_large_as_the_wall() -> None:
    """A convex solid cut by planes is convex solids of the same volume."""
    colon, wall = straight_tube(), wedge_wall()
    slabs = list(cut_into_slabs(wall, colon.centreline))
    assert len(slabs) >= colon.centreline.length / SLAB
    before = sum(ConvexHull(piece.vertices).volume for piece in wall.pieces)
    after = sum(ConvexHull(piece).volume for slab in slabs for piece in slab.pieces)
    assert after == pytest.approx(before, rel=1e-6)
    for slab in slabs:
        assert all(np.abs(piece[:, 2] - slab.arc).max() < 0.501 * SLAB for piece in slab.pieces)


def test_a_scene_of_a_colon_that_moves_holds_its_wall() -> None:
    """Pieces stand on mocap bodies; they touch where pieces are the wall's law, and are a picture beside a table."""
    tube, wall, design = straight_tube(), wedge_wall(), named_design("adult")
    for law in ("pieces", "table"):
        options = SceneOptions(wall_law=law, mesentery=True, insertion_limit=0.3)
        scene = build_scene(tube, wall, design, options, show_lumen=False)
        model = scene.compile()
        assert model.nmocap == len(scene.blocks.arcs) > 0
        pieces = [geom.id for geom in map(model.geom, range(model.ngeom)) if geom.name.startswith("wall/0")]
        assert len(pieces) >= len(wall.pieces)
        assert (model.geom_contype[pieces] == (law == "pieces")).all()
        assert (model.body_mocapid[model.geom_bodyid[pieces]] >= 0).all()
