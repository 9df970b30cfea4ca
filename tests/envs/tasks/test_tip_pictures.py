"""Pictures of all tips at once are those of exact rays to the surface that the table describes."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haustra.envs.sim.linear.cameras import ARC, BACKWARDS, EYE, RADIUS, RIGHT, UP
from haustra.envs.sim.linear.compile import assembled
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.sight import RANGE
from haustra.envs.tasks.tip_pictures import TipPictures, _wall
from haustra.envs.view.picture import mucosa, picture_program
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import MovingSurface
from haustra.errors import InvalidOptionError
from haustra.models.wall.lumen_table import stack
from haustra.models.wall.moving_colon import to_current
from tests.task_bank import DESIGN, moving_bank

SIZE = 48
STEER = np.array([[1.0, 0.3, 0.5, -0.4], [1.0, -0.6, -0.3, 0.6]])


def task_of(*, mesentery: bool, size: int = SIZE, rules: dict[str, Any] | None = None, **own: Any) -> ScopeTask:
    about = {"design": DESIGN, "observation": "pixels", "picture_size": size, "mesentery": mesentery}
    config = TaskConfig(**about, **(rules or {}))
    run: dict[str, Any] = {"worlds": 2, "backend": "linear", "bank": moving_bank()} | own
    return ScopeTask(config, **run)


def tips_of(task: ScopeTask) -> TipPictures:
    assert task._tips is not None
    return task._tips


def exact(bank: ColonSet, case: int, pose: np.ndarray | None) -> Endoscope:
    """Exact rays into a colon of the bank that nothing indents."""
    tabulated = bank.cases[case]
    colon, lens = tabulated.colon(), lens_of(bank.design.tip, SIZE, SIZE)
    if pose is None:
        return Endoscope(colon, lens, threads=1)
    surface = MovingSurface(colon, stack([tabulated.with_mesentery()]), *tabulated.own_axes)
    surface.move(pose)
    return Endoscope(colon, lens, surface=surface, threads=1)


def unlike(scope: Endoscope, pose: CameraPose, picture: np.ndarray, distance: np.ndarray) -> tuple[np.ndarray, float]:
    """Differences of distances that both know [m], and the share of pixels within three grey levels."""
    view = scope.look(pose)
    known = (view.own >= 0) & (view.distance < 0.95 * RANGE)
    off = np.abs(picture[..., :3].astype(int) - scope.develop(scope.radiance(view))).max(axis=-1)
    assert known.mean() > 0.5
    return np.abs(view.distance - distance)[known], float((off <= 3).mean())


def look_from(task: ScopeTask, poses: list[CameraPose], arcs: list[float], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Pictures and distances of cameras that are somewhere else than the scopes' tips, and indent nothing."""
    tips = tips_of(task)
    tips.draw()
    for view, pose, arc in zip(tips._views.change(), poses, arcs, strict=False):
        view[ARC], view[EYE : EYE + 3], view[RADIUS] = arc, pose.position, -1.0
        for slot, axis in zip((RIGHT, UP, BACKWARDS), pose.rotation.T, strict=True):
            view[slot : slot + 3] = axis
    monkeypatch.setattr(task.backend, "look_by", lambda program, told: None)
    return tips.both(), tips.distance


def test_the_wall_and_its_landmarks_are_those_of_exact_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Off the middle and turned aside, and before the caecum's pole with its orifice."""
    bank = moving_bank().with_mesentery(False)
    task, case = task_of(mesentery=False, bank=bank), bank.cases[0]
    arcs = [0.10, case.length - 0.04]
    frames = [case.frames[round(arc / case.step)] for arc in arcs]
    middles = [case.points[round(arc / case.step)] for arc in arcs]
    turned = frames[0] @ Rotation.from_euler("xyz", (20, -25, 40), degrees=True).as_matrix()
    poses = [CameraPose.of_tip(middles[0] + 0.007 * frames[0][:, 0], turned), CameraPose.of_tip(middles[1], frames[1])]
    task.reset(seeds=[0, 1], case=0)
    pictures, distances = look_from(task, poses, arcs, monkeypatch)
    scope = exact(bank, 0, None)
    assert {int(kind) for kind in scope.appearance.landmarks[:, 0]} == {mucosa.ORIFICE, mucosa.VALVE}
    for pose, picture, distance in zip(poses, pictures, distances, strict=True):
        apart, alike = unlike(scope, pose, picture, distance)
        assert np.median(apart) < 1e-7
        assert np.percentile(apart, 99) < 2e-5
        assert alike > 0.98


def test_a_colon_that_moved_is_drawn_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pushed by scopes with bent tips, looked into from its centreline before these."""
    task = task_of(mesentery=True)
    task.reset(seeds=[0, 1], case=np.array([0, 1]))
    for _ in range(40):
        task._episodes.step(STEER)
    moved, arcs = task.displacement, task.seen.tip_arc + 0.005
    assert moved is not None and (np.abs(moved[..., :3]).max(axis=(1, 2)) > 1e-3).all()
    places, poses = task.way_ahead(np.array([0.005, 0.025])), []
    for eye, beyond in places:
        poses.append(CameraPose(eye, looking(beyond - eye, np.array([1.0, 0.0, 0.0]))))
    pictures, distances = look_from(task, poses, arcs.tolist(), monkeypatch)
    for world, (pose, picture, distance) in enumerate(zip(poses, pictures, distances, strict=True)):
        apart, alike = unlike(exact(task.bank, world, moved[world]), pose, picture, distance)
        assert np.median(apart) < 1e-7
        assert np.percentile(apart, 99) < 2e-5
        assert alike > 0.97


def test_exact_rays_look_into_the_colon_that_physics_moves() -> None:
    """Its vertices are where the wall's own law takes them; a tabulated colon's line begins askew to its tables."""
    task = task_of(mesentery=True)
    task.reset(seeds=[0, 1], case=np.array([0, 1]))
    for _ in range(20):
        task._episodes.step(STEER)
    seen, moved = task.seen, task.displacement
    assert moved is not None
    for world, case in enumerate(task.bank.cases):
        scope, pose = task.pictures._looking(
            world, (seen.tip[world], seen.tip_frame[world]), float(seen.tip_arc[world]), SIZE, moved[world]
        )
        assert isinstance(scope.surface, MovingSurface)
        tables = stack([case.with_mesentery()])
        assert tables.mesentery is not None and np.allclose(pose.position, seen.tip[world])
        own = moved[world, : tables.mesentery.nodes.shape[1]]
        points, arcs = scope.surface.rest, scope.surface.arcs
        far = np.flatnonzero(arcs > seen.tip_arc[world] + 0.1)  # where no tip presses
        there = to_current(np, tables, own[None], points[None, far], arcs[None, far])[0]
        for stretch in range(scope.surface.count):
            scope.surface.bring(stretch)
        np.testing.assert_allclose(scope.surface.vertices[far], there, atol=1e-9)


def test_a_tip_that_presses_the_wall_sees_it_give_way() -> None:
    """Red all over where it presses; beside it the lumen, as where surfaces make room for the tip."""
    task = task_of(mesentery=True)
    task.reset(seeds=[0, 1], case=np.array([0, 1]))
    for _ in range(30):
        task._episodes.step(STEER)
    seen, moved, pictures = task.seen, task.displacement, tips_of(task).both()
    assert moved is not None
    for world in range(2):
        own = task.seen.tip[world], task.seen.tip_frame[world]
        drawn = task.pictures.both(world, own, float(seen.tip_arc[world]), SIZE, moved[world])
        off = np.abs(drawn.astype(int) - pictures[world])
        assert (pictures[world, ..., 3].max() < 10) and (off[..., :3].max(axis=-1) <= 3).mean() > 0.95


def test_what_the_wall_bears_is_drawn() -> None:
    """Polyps' red, blood and stool that are known of the table's places, as of the vertices of the surface."""
    bank = moving_bank().with_mesentery(False)
    task = task_of(mesentery=False, bank=bank)
    plain = task.reset(seeds=[0, 1], case=0)["pixels"].astype(int)
    tips = tips_of(task)
    known = tips._held["known"]
    known[:, 3 + mucosa.BLOOD] = 1.0
    bloody = tips.both().astype(int)
    lit = plain[..., 1] > 60
    assert (bloody[lit][:, 1] < plain[lit][:, 1]).mean() > 0.95
    assert (np.abs(bloody[..., 3] - plain[..., 3]) == 0).all()


def test_stool_and_mucus_are_drawn_as_by_exact_rays_and_refused_without_colour() -> None:
    """The looks of both are the law's; distances stay as they were."""
    bank = moving_bank().with_mesentery(False)
    clean, dirty = (task_of(mesentery=False, bank=bank, rules=rules) for rules in ({}, {"stool": 0.6, "mucus": 0.4}))
    plain, seen = (task.reset(seeds=[0, 1], case=np.array([0, 1]))["pixels"].astype(int) for task in (clean, dirty))
    assert (np.abs(seen - plain)[..., :3].max(axis=-1) > 10).mean() > 0.2
    np.testing.assert_array_equal(seen[..., 3], plain[..., 3])
    for world in range(2):
        own = dirty.seen.tip[world], dirty.seen.tip_frame[world]
        drawn = dirty.pictures.both(world, own, float(dirty.seen.tip_arc[world]), SIZE)
        assert (np.abs(drawn.astype(int) - seen[world]).max(axis=-1) <= 3).mean() > 0.95
    with pytest.raises(InvalidOptionError, match="choose observation 'pixels'"):
        ScopeTask(TaskConfig(design=DESIGN, observation="depth", mucus=0.1), bank=bank)


@pytest.mark.parametrize("size", [8, 13])
def test_any_size_is_exposed_alike(size: int) -> None:
    """Sizes that no lanes divide: the upper quarter of what is lit is exposed as one picture of exact rays."""
    task = task_of(mesentery=False, size=size, bank=moving_bank().with_mesentery(False))
    seen = task.reset(seeds=[0, 1], case=np.array([0, 1]))["pixels"]
    for world in range(2):
        own = task.seen.tip[world], task.seen.tip_frame[world]
        drawn = task.pictures.both(world, own, float(task.seen.tip_arc[world]), size)
        assert (np.abs(drawn.astype(int) - seen[world]).max(axis=-1) <= 3).mean() > 0.95


def test_pictures_are_in_place_after_each_control_step() -> None:
    """As libraries take them by DLPack, and on several threads the same as on one."""
    task, alone = (task_of(mesentery=True, worlds=3, threads=threads) for threads in (2, 1))
    for each in (task, alone):
        each.reset(seeds=[0, 1, 2], case=np.array([0, 1, 0]))
    place = task.in_place
    place.action[:] = 0.5
    task.advance()
    held = np.from_dlpack(place.observation["pixels"])
    assert held.shape == (3, SIZE, SIZE, 4) and held.dtype == np.uint8 and held.std() > 20
    seen = alone.step(np.full((3, 4), 0.5)).observation["pixels"]
    np.testing.assert_array_equal(held, seen)
    task.close()


def test_a_gpu_is_given_the_same_programs() -> None:
    """As assembly that calls no library: the driver needs nothing else."""
    about: dict[str, Any] = {"moving": True, "kinds": (0, 1), "guides": 3, "angles": 48, "reach": RANGE, "tiled": True}
    text = assembled(picture_program.write_look(lanes=1, **about))
    assert ".entry look" in text and "call" not in text and ".extern" not in text
    ranks = assembled(picture_program.write_ranks(lanes=1))
    assert ".entry rank" in ranks


def test_the_surface_that_normals_are_of_has_them_inwards() -> None:
    """At each place of the table towards the centreline."""
    case = moving_bank().cases[0]
    known = _wall(case, None).known
    rays = case.points[:, None] - case.colon().lumen.vertices[: case.sight.size].reshape(*case.sight.shape, 3)
    assert (np.einsum("sai,sai->sa", known[..., :3], rays) > 0).all()
