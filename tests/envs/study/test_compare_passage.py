"""What one passage tells beside forces: mucosa seen, widths worked in, and a film of it."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from haustra.envs.runs.device_run import run_device
from haustra.envs.study.compare_patients import Patient
from haustra.envs.study.compare_pictures import draw
from haustra.envs.study.compare_sight import Looks, looked_at, mucosa_seen
from haustra.envs.study.compare_widths import advance_by_width, passed_bands
from haustra.envs.tasks.coverage import CELL
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import device_options
from haustra.models.devices.base import load_device
from haustra.models.wall.lumen_table import axis_tables
from haustra.models.wall.moving_colon import AT_REST, POSE
from tests.tube_colon import RADIUS, straight_tube


def seen(colon: Colon, arcs: np.ndarray, *, view_deg: float = 140.0, moved: float | None = None) -> float:
    """Share seen by a camera that goes along the axis, in a colon moved sideways as a whole."""
    shape = (len(arcs), 0, POSE)
    displacement = np.zeros(shape)
    if moved is not None:
        mesentery = axis_tables(colon).mesentery
        assert mesentery is not None
        displacement = np.tile(np.asarray(AT_REST, float), (len(arcs), len(mesentery.nodes), 1))
        displacement[..., 0] = moved
    tip = np.column_stack([np.full(len(arcs), moved or 0.0), np.zeros(len(arcs)), arcs])
    frames = np.broadcast_to(np.eye(3), (len(arcs), 3, 3))
    looks = Looks(tip, frames, arcs, displacement)
    return mucosa_seen(colon, looks, view_deg=view_deg, device_radius=0.006)


def test_a_camera_in_a_tube_sees_the_wall_between_its_angle_and_60_mm() -> None:
    """A view of 140 degrees begins RADIUS / tan(70 degrees) = 7 mm ahead; 60 mm off the axis it is 57 mm ahead."""
    tube = straight_tube(0.3)
    begins, ends = RADIUS / np.tan(np.radians(70)), np.sqrt(0.06**2 - RADIUS**2)
    assert seen(tube, np.array([0.1])) == pytest.approx((ends - begins) / 0.3, abs=1.5 * CELL / 0.3)
    passed = seen(tube, np.linspace(0.1, 0.2, 21))
    assert passed == pytest.approx((ends - begins + 0.1) / 0.3, abs=1.5 * CELL / 0.3)
    assert seen(tube, np.array([0.1]), view_deg=100.0) < seen(tube, np.array([0.1]))


def test_what_is_seen_does_not_change_when_colon_and_camera_move_together() -> None:
    tube, arcs = straight_tube(0.3), np.array([0.1, 0.15])
    assert seen(tube, arcs, moved=0.02) == pytest.approx(seen(tube, arcs), abs=0.01)


def test_looks_are_a_fifth_of_a_second_apart() -> None:
    assert looked_at(0.02 * np.arange(1, 26)).tolist() == [0, 10, 20, 24]


def test_way_and_time_go_to_the_widths_where_they_were_spent() -> None:
    """10 mm/s through 20 mm wide lumen, then for as long at a stand in 40 mm; a way back gains nothing."""
    tube = straight_tube(0.2)
    radius = np.where(tube.centreline.arc < 0.1, 0.0125, 0.0225)[:, None] * np.ones(48)
    colon, time = replace(tube, radius=radius), 0.5 * np.arange(1, 41)
    arcs = np.concatenate([np.linspace(0.0, 0.098, 20), np.full(10, 0.105), np.full(10, 0.102)])
    run = passed_bands(colon, time, arcs)
    narrow, wide = advance_by_width([run, run])
    assert (narrow["from_mm"], narrow["to_mm"], wide["from_mm"]) == (20.0, 30.0, 40.0)
    assert narrow["seconds"] == wide["seconds"] == pytest.approx(20.0)
    assert narrow["gained_m"] == pytest.approx(2 * 0.098) and wide["gained_m"] == pytest.approx(2 * 0.007)
    assert narrow["speed_mm_s"] == pytest.approx(9.8)


def test_a_device_on_the_mesentery_is_filmed(tmp_path) -> None:
    tube = straight_tube(0.2)
    device = load_device("capsule")
    run = run_device(device, tube, device_options(device, mesentery=True), seconds=0.06)
    assert run.records["displacement"].shape[0] == 3 and run.records["displacement"].shape[2] == POSE
    draw(run, Patient("tube-0", 0, 0.05, 1500.0), tmp_path / "pictures" / "capsule.png")
    with Image.open(tmp_path / "pictures" / "capsule.webp") as film:
        pictures = []
        for number in range(film.n_frames):  # type: ignore[attr-defined]
            film.seek(number)
            pictures.append(np.asarray(film.convert("RGB"), float))
    assert len(pictures) == 3 and pictures[0].shape[1] == 640
    eye, outside = pictures[0][:320, :320], pictures[0][:320, 320:]
    assert eye.std() > 10 and outside.std() > 10
