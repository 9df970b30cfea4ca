"""A wall keeps the lumen free, has no holes, and says how far it is from the lumen surface."""

import mujoco
import numpy as np
import pytest
from manifold3d import Manifold, Mesh64

from haustra.errors import InvalidOptionError, WallAccuracy
from haustra.models.wall.pieces.blocks import ENTRY_RADIUS
from haustra.models.wall.pieces.build import build_wall
from haustra.models.wall.pieces.rays import Caster, joined_hulls
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

RAYS = 2000


@pytest.fixture(scope="module")
def walls(tube_colon, hairpin_colon):
    """Prism walls of both colons; the cache is left out of it."""
    return {
        colon.name: (colon, build_wall(colon, method="prism", rays=RAYS, workers=1, use_cache=False))
        for colon in (tube_colon, hairpin_colon)
    }


@pytest.mark.parametrize("name", ["bent tube", "hairpin"])
def test_error_of_prisms_stays_within_what_was_aimed_at(walls, name):
    error = walls[name][1].error
    assert error.leaks == 0
    assert error.rays > 0.95 * RAYS
    assert error.intrusion_p95_mm <= 1.0  # the project's bar
    assert abs(error.mean_signed_mm) <= 0.2  # likewise
    assert error.intrusion_p95_mm <= error.intrusion_max_mm


def test_no_piece_of_one_loop_stands_in_the_lumen_of_the_next(walls):
    """The hairpin's straights are 2 mm apart and its pieces are 30 mm thick."""
    colon, wall = walls["hairpin"]
    lumen = Manifold(Mesh64(colon.lumen.vertices, colon.lumen.faces.astype(np.uint64)))
    inside = np.array([(Manifold.hull_points(piece.vertices) ^ lumen).volume() for piece in wall.pieces])
    area = lumen.surface_area()
    # As much as an even layer of the tolerance's third would take; one loop of pieces in the other is 50 times that.
    assert inside.sum() < area * 0.0005
    line = colon.centreline.points
    for piece in wall.pieces:
        hull = Manifold.hull_points(piece.vertices)
        assert np.linalg.norm(line - piece.vertices.mean(axis=0), axis=1).min() > 0.005
        assert hull.volume() > 0


def test_the_way_in_is_open_and_the_far_end_is_closed(walls):
    colon, wall = walls["bent tube"]
    caster = Caster(joined_hulls([piece.vertices for piece in wall.pieces]))
    line = colon.centreline
    first, second, tangent = line.frames[0].T
    for angle in np.linspace(0, 2 * np.pi, 12):
        aside = 0.95 * ENTRY_RADIUS * (np.cos(angle) * first + np.sin(angle) * second)
        assert caster.entry(line.points[0] - 0.1 * tangent + aside, tangent[None])[0] > 0.1
    end = line.points[-1]
    forward = line.frames[-1] @ np.array([[0.3, 0, 1], [-0.3, 0.2, 1], [0, 0, 1.0]]).T
    directions = (forward / np.linalg.norm(forward, axis=0)).T
    assert (caster.entry(end, directions) < 0.03).all()


def test_pieces_compile_in_mujoco_and_are_met_where_they_were_measured(walls):
    colon, wall = walls["bent tube"]
    spec = mujoco.MjSpec()
    for number, piece in enumerate(wall.pieces):
        spec.add_mesh(name=f"piece{number}", uservert=piece.vertices.ravel().tolist())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece{number}")
    model = spec.compile()
    assert model.ngeom == len(wall.pieces)
    assert model.mesh_vertnum.max() <= 64
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    caster = Caster(joined_hulls([piece.vertices for piece in wall.pieces]))
    line = colon.centreline
    for station in range(5, len(line.arc), 9):
        direction = line.frames[station][:, 0] + 0.2 * line.frames[station][:, 1]
        direction /= np.linalg.norm(direction)
        met = mujoco.mj_ray(model, data, line.points[station], direction, None, 1, -1, np.zeros(1, np.int32))
        assert met == pytest.approx(caster.entry(line.points[station], direction[None])[0], abs=1e-5)


def test_pieces_are_thick_where_there_is_room(walls):
    colon, wall = walls["bent tube"]
    caster = Caster(joined_hulls([piece.vertices for piece in wall.pieces]))
    line, station = colon.centreline, 6  # on the first straight, away from the bend
    for outwards in (line.frames[station][:, 0], -line.frames[station][:, 0]):
        back = caster.distance(line.points[station] + 0.2 * outwards, -outwards[None])[0]
        front = caster.entry(line.points[station], outwards[None])[0]
        assert 0.2 - back - front >= 0.029


@pytest.mark.slow
def test_coacd_keeps_the_same_bars_and_its_blocks_come_from_the_cache_the_second_time(cache):
    tube_colon = swept_colon(winding([(0.006, 0.0), (0.018, 0.45), (0.006, 0.0)]), name="short bent tube")
    told = []
    first = build_wall(tube_colon, rays=RAYS, workers=1, progress=lambda *what: told.append(what))
    assert first.error.intrusion_p95_mm <= 1.0
    assert abs(first.error.mean_signed_mm) <= 0.2
    assert first.error.leaks <= RAYS / 1000
    assert first.metadata["blocks_fallen_back"] == 0
    assert told[-1] == ("measuring", 1, 1)
    assert not first.metadata["cached"]
    again = build_wall(tube_colon, rays=RAYS, workers=1)
    assert again.metadata["cached"]
    assert again.error == first.error
    blocks = build_wall(tube_colon, rays=RAYS + 1000, workers=1)
    assert blocks.metadata["blocks_cached"] == blocks.metadata["blocks"]
    assert len(blocks.pieces) == len(first.pieces)


def test_a_wall_over_the_error_asked_for_is_refused(tube_colon, cache):
    with pytest.raises(WallAccuracy, match=r"more than the 0\.01 mm asked for"):
        build_wall(tube_colon, method="prism", tolerance=0.005, rays=1000, workers=2, max_error_mm=0.01)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "voxels"}, "Known: coacd, prism"),
        ({"thickness": 0.0}, "thickness is 0.0"),
        ({"tolerance": float("nan")}, "tolerance is nan"),
        ({"rays": 10}, "at least 1000 rays"),
        ({"workers": 0}, "1 worker"),
    ],
)
def test_impossible_options_are_refused(tube_colon, options, said, request):
    if options.get("method") == "voxels":  # the runtime type check of the tests would refuse it first
        from haustra.models.wall.pieces.build import WallOptions

        with pytest.raises(Exception, match="voxels"):
            WallOptions(**options)
        return
    with pytest.raises(InvalidOptionError, match=said):
        build_wall(tube_colon, **options)
