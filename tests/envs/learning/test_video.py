"""The best episode as a recording and as a moving picture."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from haustra.envs.learning.evaluate import Evaluation, evaluate
from haustra.envs.learning.recording import Recording
from haustra.envs.learning.stage import stage_of
from haustra.envs.learning.video import HEIGHT, WIDTH, write_video
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver, PushDriver
from haustra.envs.view.picture.lens import lens_of
from tests.task_bank import DESIGN, moving_bank, short_bank, tip_arcs

SERIES = ("time", "tip_arc", "progress", "push_force", "wall_force")
CONFIG = TaskConfig(design=DESIGN, observation="state", limits=Limits(seconds=12.0))


def driven(driver, *, seconds: float = 12.0) -> tuple[Evaluation, Recording]:
    config = TaskConfig(design=DESIGN, observation="state", limits=Limits(seconds=seconds))
    found = evaluate(driver, "someone", config, short_bank(), episodes=2, threads=1, record=True)
    assert found.recording is not None
    return found, found.recording


def draw(path, recording: Recording, **options):
    return write_video(
        path,
        recording,
        short_bank(),
        title="someone in a colon with a long name",
        ending="time up",
        limits=CONFIG.limits,
        **options,
    )


def test_the_best_episode_is_kept_to_its_end():
    found, kept = driven(FollowerDriver)
    ranks = [(one.safe, one.reached, one.progress, -one.seconds) for one in found.episodes]
    best = found.episodes[kept.number]
    assert ranks[kept.number] == max(ranks)
    assert short_bank().cases[kept.case].name == best.colon
    assert kept.time[-1] == pytest.approx(best.seconds) and kept.progress[-1] == pytest.approx(best.progress)
    assert np.diff(kept.time)[:-1] == pytest.approx(0.2, abs=1e-5)
    assert kept.wall_force.max() == pytest.approx(best.peak_force_N, rel=1e-6), "no peak falls between two states"


def test_recorded_joints_put_the_tip_where_it_was():
    _, kept = driven(PushDriver, seconds=2.0)
    assert tip_arcs(kept) == pytest.approx(kept.tip_arc, abs=0.005)


def test_a_video_shows_the_scope_moving_and_how_it_ended(tmp_path):
    _, kept = driven(PushDriver, seconds=1.0)
    with Image.open(draw(tmp_path / "push.webp", kept)) as video:
        assert (getattr(video, "n_frames", 1), video.size) == (len(kept.time), (WIDTH, HEIGHT))
        pictures = []
        for frame in (0, len(kept.time) - 2, len(kept.time) - 1):
            video.seek(frame)
            pictures.append(np.asarray(video.convert("RGB")).astype(int))
    first, before, last = pictures
    outside, ending = np.s_[:, 200:], np.s_[277:, :190]
    darker = (first - last)[outside].max(axis=2) > 60
    assert darker.sum() > 20, "the scope is farther in at the end"
    assert np.abs(first - last)[:190, :190].mean() > 1, "the tip sees something else"
    assert np.abs(before - last)[ending].max() > 100, "the ending is written below the last frame"
    assert np.abs(first - before)[ending].max() < 30


def test_a_tip_that_has_pressed_the_wall_away_sees_wall(tmp_path):
    """A scope that is bent by hand until its tip stands outside the tube, as in a soft wall."""
    _, kept = driven(PushDriver, seconds=2.0)
    model = short_bank().scene.cable
    bend = np.tile(kept.qpos[-1], (2, 1))
    bend[:, -2 * model.tip_links :] += 0.25
    bent = replace(kept, qpos=bend, **{name: getattr(kept, name)[-2:] for name in SERIES})
    with Image.open(draw(tmp_path / "bent.webp", bent)) as video:
        picture = np.asarray(video.convert("RGB")).astype(int)[:192, :192]
    rows, columns = np.mgrid[:192, :192] - 95.5
    lens = np.hypot(rows, columns) < 85
    assert (picture[lens].max(axis=1) > 40).mean() > 0.7, "the rest is the depth of the lumen"


def test_a_scope_that_was_pulled_out_is_drawn(tmp_path):
    _, kept = driven(PushDriver, seconds=0.4)
    out = kept.qpos.copy()
    out[:, 0] -= 0.1
    draw(tmp_path / "out.webp", replace(kept, qpos=out, tip_arc=kept.tip_arc - 0.1))
    assert (tmp_path / "out.webp").stat().st_size > 1000


def test_a_drawing_that_is_interrupted_leaves_nothing(tmp_path):
    _, kept = driven(PushDriver, seconds=0.6)

    def stop(done: int, frames: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        draw(tmp_path / "push.webp", kept, progress=stop)
    assert not list(tmp_path.iterdir())


def test_in_a_colon_that_moves_the_picture_moves_along():
    """What the axis did is recorded; of a colon whose middle is carried 2 cm away, wall and lens are there."""
    config = replace(CONFIG, mesentery=True, limits=Limits(seconds=3.0))
    bank = moving_bank()
    kept = evaluate(PushDriver, "push", config, bank, episodes=1, backend="linear", record=True).recording
    assert kept is not None and kept.displacement is not None and kept.displacement.shape[0] == len(kept.time)
    assert np.abs(kept.displacement[0, :, :3]).max() < np.abs(kept.displacement[-1, :, :3]).max() < 0.02

    case, away = bank.cases[kept.case], 0.02
    displacement = np.zeros_like(kept.displacement[:1])
    displacement[..., 3] = 1.0
    displacement[0, :, 0] = away * np.sin(np.linspace(0, np.pi, len(displacement[0]))) ** 2
    displacement = np.pad(displacement, ((0, 0), (0, 7), (0, 0)), mode="edge")  # as beside a longer colon
    lens = lens_of(bank.design.tip, 32, 32)
    stage, still = stage_of(case, displacement, lens, (96, 96)), stage_of(case, None, lens, (96, 96))
    middle = len(case.points) // 2
    place, arc = case.points[middle] + [away, 0.0, 0.0], case.step * middle
    eye, outside = stage.at(0, place, arc)
    _, before = still.at(0, place, arc)
    for stretch in range(stage.surface.count):
        stage.surface.bring(stretch)
    moved = stage.surface.vertices - still.surface.vertices
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(away, rel=0.3)
    assert eye == pytest.approx(place, abs=0.001), "in the middle of the lumen, where that is now"
    pictures = [view.draw(None, 0.005, bending_length=0.05).astype(int) for view in (outside, before)]
    assert (np.abs(pictures[0] - pictures[1]).max(axis=2) > 20).sum() > 50
