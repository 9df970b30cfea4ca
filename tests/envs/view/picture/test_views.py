"""Pictures show what is there, without any OpenGL."""

import sys

import numpy as np
import pytest
import trimesh

from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.outside import default_rotation, outside_view
from haustra.models.anatomy.colon import Surface


@pytest.fixture(scope="module")
def pipe() -> Surface:
    """A closed tube of 20 mm radius along x, from -0.2 to 0.2 m."""
    mesh = trimesh.creation.cylinder(0.02, 0.4, sections=48)
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 0.02)[:2]
    turned = vertices @ looking(np.array([-1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])).T
    return Surface(np.ascontiguousarray(turned), np.asarray(faces))


def test_the_scope_shines_through_the_translucent_colon(pipe: Surface) -> None:
    across = looking(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    points = np.stack([np.linspace(-0.19, 0.05, 40), np.zeros(40), np.zeros(40)], axis=1)
    options = {"rotation": across, "width": 200, "height": 100}
    empty = outside_view(pipe, **options).astype(float)
    filled = outside_view(pipe, points, 0.0064, **options).astype(float)
    changed = np.abs(filled - empty).max(axis=2) > 30
    rows, columns = np.nonzero(changed)
    assert 45 <= rows.min() <= rows.max() <= 55, "only where the scope is"
    assert 8 <= columns.min() <= 20
    assert 115 <= columns.max() <= 130
    corner, colon = empty[2, 2], empty[42, 160]
    assert corner.min() > 220, "the background is light"
    assert colon[0] - colon[2] > 10, "the colon is pink"
    assert colon.min() > 80, "and translucent"


def test_the_colon_is_seen_as_if_one_faced_the_patient() -> None:
    """Anus below, caecum on the viewer's left, whichever way the scan's axes run."""
    arch = np.array([[0.0, 0, 0], [0.2, 0, 0.1], [0.2, 0, 0.4], [0, 0, 0.45], [-0.2, 0, 0.4], [-0.2, 0, 0.2]])
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.03)
    vertices = np.concatenate([ball.vertices + point for point in arch])
    faces = np.concatenate([ball.faces + k * len(ball.vertices) for k in range(len(arch))])
    for turn in _turns():
        turned = trimesh.transform_points(vertices, turn)
        path = trimesh.transform_points(arch, turn)
        rotation = default_rotation(Surface(turned, faces), path)
        seen = (path - turned.mean(axis=0)) @ rotation
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert seen[0, 1] < 0, "the anus is below"
        assert seen[-1, 0] < 0, "the caecum is on the left"


def _turns() -> list[np.ndarray]:
    return [trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3)) for seed in range(5)]


def test_a_real_colon_is_drawn_in_seconds(shared_data) -> None:
    mesh = trimesh.load(shared_data / "colons" / "EdinGCA_3D_00020_lumen_mm.stl")
    assert isinstance(mesh, trimesh.Trimesh)
    lumen = Surface(mesh.vertices.view(np.ndarray) * 1e-3, mesh.faces.view(np.ndarray))
    picture = outside_view(lumen)
    assert picture.shape == (700, 900, 3)
    assert 0.15 < (np.ptp(picture.astype(int), axis=2) > 15).mean() < 0.9, "the colon fills the picture"


@pytest.mark.skipif(sys.platform != "linux", reason="names Linux back-ends")
def test_mujoco_draws_the_scene_where_a_back_end_works() -> None:
    import mujoco

    from haustra.envs.view.picture.backends import best_backend
    from haustra.envs.view.picture.gl import scene_frames
    from haustra.errors import MissingDependencyError

    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><light pos='0 0 2'/><camera name='eye' pos='0 -1 0' xyaxes='1 0 0 0 0 1'/>"
        "<body><joint type='slide' axis='1 0 0'/><geom size='.1' rgba='1 0 0 1'/></body></worldbody></mujoco>"
    )
    positions = np.array([[0.0], [0.3]])
    if best_backend() is None:
        with pytest.raises(MissingDependencyError, match="no OpenGL back-end"):
            scene_frames(model, positions, camera="eye")
        return
    frames = scene_frames(model, positions, camera="eye", width=64, height=48).astype(int)
    reds = [np.nonzero(frame[..., 0] - frame[..., 2] > 60)[1].mean() for frame in frames]
    assert reds[1] > reds[0] + 5, "the ball moved to the right"
