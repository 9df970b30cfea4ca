"""Episodes in colons that move on their mesentery."""

from importlib.util import find_spec
from unittest.mock import Mock

import numpy as np
import pytest

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.tasks.case import load_case, save_case
from haustra.envs.tasks.config import TaskConfig, Weights
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.view.picture.lens import lens_of
from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.devices.scope.library import named_design
from haustra.models.wall import moving_colon
from tests.task_bank import DESIGN, moving_bank

pytest.importorskip("jax")


from haustra.envs.tasks.device_sight import DeviceEyes
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.sight import HostEyes, Sight

NEEDS_WARP = pytest.mark.skipif(find_spec("warp") is None, reason="the extra warp is not installed")


def test_a_case_keeps_its_segments(tmp_path):
    case = moving_bank().cases[0]
    read = load_case(save_case(tmp_path / "case.npz", case))
    assert [each.name for each in read.segments] == list(SEGMENTS)
    assert read.segments[1].end == pytest.approx(0.6 * case.length)
    own = read.with_mesentery().mesentery
    assert own is not None and 0 < (own.slack > 0).mean() < 0.7


@pytest.mark.parametrize("backend", ["linear", pytest.param("warp", marks=NEEDS_WARP)])
def test_a_follower_drives_in_colons_that_move(backend):
    """The colon moves where it is hung, the way ahead and what is seen move along, and the tip gets on."""
    config = TaskConfig(
        design=DESIGN, observation="dict", privileged=True, mesentery=True, imager=True, weights=Weights(facing=1.0)
    )
    task = ScopeTask(config, worlds=2, backend=backend, bank=moving_bank())
    seen = task.reset(seeds=[1, 2], case=np.array([0, 1]))
    driver = FollowerDriver(task)
    driver.begin(np.ones(2, bool))
    rest = task.way_ahead(np.array([0.03]))
    done = task.step(driver.act(seen))
    for _ in range(60):
        done = task.step(driver.act(done.observation))
    assert (done.info["progress"] > 0.2).all()
    assert (np.abs(done.info["reward_facing"]) < 0.5).all()
    for _ in range(60):  # pushed on without steering, it leans on the bend
        done = task.step(np.tile([0.67, 0.0, 0.0, 0.0], (2, 1)))
    moved = np.linalg.norm(np.asarray(task.backend.displacement)[..., :3], axis=2)
    assert not done.info["diverged"].any()
    assert (moved.max(axis=1) > 1e-4).all() and moved[:, 0].max() < 1e-4
    assert all(np.isfinite(part).all() for part in done.observation.values())
    assert np.linalg.norm(task.way_ahead(np.array([0.03])) - rest, axis=-1).min() > 0.01
    task.reset(np.array([1]))
    displacement = np.asarray(task.backend.displacement)[..., :3]
    assert not displacement[1].any() and displacement[0].any()
    task.close()


def test_a_camera_that_moves_with_the_colon_sees_the_same():
    """The whole colon, and the eye, 5 cm aside: distances to the wall as at rest."""
    bank = moving_bank()
    mesentery = bank.tables.mesentery
    assert mesentery is not None
    aside = np.array([0.03, -0.04, 0.0])

    backend = Mock(spec=AbstractBackend, tables=bank.tables)
    backend.displacement = moving_colon.at_rest(np, mesentery, 2, float).pose
    backend.displacement[..., :3] = aside
    case, arc = np.array([0, 1]), np.array([0.05, 0.12])
    rows = [round(s / bank.cases[0].step) for s in arc]
    eye = np.array([bank.cases[k].points[row] for k, row in zip(case, rows, strict=True)])
    frame = np.array([bank.cases[k].frames[row] for k, row in zip(case, rows, strict=True)])
    still = Sight(bank.cases).tip_distances(case, eye, frame, arc)
    for eyes in (DeviceEyes, HostEyes):
        moved = eyes(Sight(bank.cases), backend).tip_distances(case, eye + aside, frame, arc)
        assert np.abs(still - moved).max() < 1e-4
    lens = {"field_of_view_deg": 140.0, "size": 16}
    eyes, drawn = DeviceEyes(Sight(bank.cases), backend), []
    for way in (0.0, aside):
        backend.displacement[..., :3] = way
        drawn.append(eyes.depth(case, eye + way, frame, arc, **lens))
    assert np.abs(drawn[0].astype(int) - drawn[1]).max() <= 1


def test_colons_that_move_are_drawn_in_colour():
    """The picture goes along with the wall: pushed on without steering, the tip sees other wall, and never outside."""
    config = TaskConfig(design=DESIGN, observation="pixels", picture_size=32, mesentery=True)
    task = ScopeTask(config, worlds=1, backend="linear", bank=moving_bank())
    first = task.reset(seeds=[1], case=np.array([0]))["pixels"]
    for _ in range(20):
        task.step(np.array([[0.67, 0.0, 0.0, 0.0]]))
    seen = task.observe()["pixels"]
    assert seen.shape == (1, 32, 32, 4) and seen.dtype == np.uint8
    within = lens_of(named_design(DESIGN).tip, 32, 32).within
    red, blue, depth = (seen[0, ..., band][within].astype(int) for band in (0, 2, 3))
    assert depth.min() > 0 and (red > blue).mean() > 0.99
    assert np.abs(seen.astype(int) - first).max() > 30


def test_only_linear_time_withdraws_from_colons_that_move():
    with pytest.raises(UnsupportedSceneError, match="mesentery"):
        ScopeTask(TaskConfig(design=DESIGN, mesentery=True, task="withdrawal"), backend="native", bank=moving_bank())
