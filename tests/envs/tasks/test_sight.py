"""What a camera sees: distances in tubes of known shape, and which of the wall has been in view."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from haustra.envs.tasks.coverage import Camera, Coverage
from haustra.envs.tasks.pictures import Pictures, in_bytes
from haustra.envs.tasks.sight import RANGE, Sight, ray_directions
from haustra.models.wall import vectors
from tests.task_bank import short_bank

TUBE = 0.02
"""Radius of the tubes [m]."""


def straight_ahead(arc: float) -> tuple[np.ndarray, np.ndarray]:
    case = short_bank().cases[0]
    station = round(arc / case.step)
    return case.points[station], case.frames[station]


def camera(arc: float, *, aside: float = 0.0) -> Camera:
    eye, frame = straight_ahead(arc)
    up, left, ahead = (vectors.of(column) for column in frame.T)
    return Camera(vectors.of(eye + aside * frame[:, 0]), (up, left, ahead), arc)


def test_rays_end_at_the_wall_of_a_tube():
    sight, arc = Sight(short_bank().cases), 0.04
    eye, frame = straight_ahead(arc)
    rays = ray_directions()
    found = sight.distances(np.array([0]), eye[None], (rays @ frame.T)[None], np.array([arc]))[0]
    assert found.shape == (25,) and (found <= RANGE).all()
    assert found[17:] == pytest.approx(TUBE / np.sin(np.radians(60)), rel=0.03)  # between two folds
    assert found[0] > 0.06


def test_a_bend_is_seen_on_its_outer_side():
    sight, arc = Sight(short_bank().cases), 0.05
    eye, frame = straight_ahead(arc)
    towards = short_bank().cases[0].points[round((arc + 0.08) / short_bank().cases[0].step)] - eye
    side = frame.T @ towards
    found = sight.distances(np.array([0]), eye[None], (ray_directions() @ frame.T)[None], np.array([arc]))[0]
    ring = found[1:9]
    turn = 2 * np.pi * np.arange(8) / 8
    deep = np.array([ring @ np.cos(turn), ring @ np.sin(turn)])
    assert deep @ side[:2] > 0.5 * np.linalg.norm(deep) * np.linalg.norm(side[:2])


def test_coverage_grows_with_what_was_in_view_and_stays():
    bank = short_bank()
    coverage = Coverage(bank.cases, Sight(bank.cases), 1, field_of_view_deg=140.0)
    coverage.begin(0, 0)
    shares = []
    for arc in np.linspace(0.25, 0.02, 24):
        shares.append(coverage.look(0, 0, camera(arc))[0])
    assert all(after >= before for before, after in pairwise(shares))
    assert 0.05 < shares[0] < 0.25  # 3 cm of 28 ahead, less what lies beside the camera and behind folds
    assert shares[-1] > 0.85
    blind = Coverage(bank.cases, Sight(bank.cases), 1, field_of_view_deg=140.0)
    blind.begin(0, 0)
    share, (missed, *way) = blind.look(0, 0, camera(0.1, aside=0.05))
    assert share == 0.0  # behind the wall nothing is seen
    assert missed == 1.0
    assert way[0] < -0.5  # what was missed lies back towards the middle


def test_the_device_sees_what_the_host_sees():
    """Tips off the middle, turned at random, in two colons: the same distances but for rounding at a fold's edge."""
    pytest.importorskip("jax")
    from haustra.envs.tasks.device_sight import DeviceEyes

    sight, random, worlds = Sight(short_bank().cases), np.random.default_rng(0), 40
    case = random.integers(0, 2, worlds)
    arc = random.uniform(0.0, 0.25, worlds)
    stations = [(short_bank().cases[k], round(s / short_bank().cases[k].step)) for k, s in zip(case, arc, strict=True)]
    eye = np.array([one.points[row] for one, row in stations]) + random.normal(size=(worlds, 3)) * 0.003
    frame = np.array([one.frames[row] @ Rotation.random(rng=random).as_matrix() for one, row in stations])
    host = sight.tip_distances(case, eye, frame, arc)
    device = DeviceEyes(sight).tip_distances(case, eye, frame, arc)
    apart = np.abs(host - device)
    assert np.median(apart) < 1e-6
    assert (apart > 1e-4).mean() < 0.01
    assert host.std() > 0.005


def test_the_device_draws_what_the_host_draws():
    """Depth pictures of both, but for pixels at a fold's edge."""
    pytest.importorskip("jax")
    from haustra.envs.tasks.device_sight import DeviceEyes

    bank = short_bank()
    sight, case, arc = Sight(bank.cases), np.array([0, 1]), np.array([0.05, 0.12])
    stations = [(bank.cases[k], round(s / bank.cases[k].step)) for k, s in zip(case, arc, strict=True)]
    eye = np.array([one.points[row] for one, row in stations])
    frame = np.array([one.frames[row] for one, row in stations])
    pictures = Pictures(bank, sight, 140.0)
    host = in_bytes(pictures.depth(case, eye, frame, arc, 24))
    device = DeviceEyes(sight).depth(case, eye, frame, arc, field_of_view_deg=140.0, size=24)
    assert device.shape == (2, 24, 24)
    assert (np.abs(host.astype(int) - device) > 1).mean() < 0.01
    assert (device[:, 0, 0] == 0).all() and device.max() > 100
