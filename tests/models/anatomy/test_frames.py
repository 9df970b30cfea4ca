import numpy as np
import pytest

from haustra.models.anatomy.frames import (
    arc_length,
    centreline_through,
    curvature,
    resample,
    rotation_minimising_frames,
    smooth,
)


def circle(radius: float, turns: float = 0.5, count: int = 400) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi * turns, count)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])


def helix(radius: float, pitch: float, turns: float, count: int) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi * turns, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle / (2 * np.pi)])


def test_stations_are_at_equal_arc_steps_and_keep_the_length():
    stations = resample(circle(0.1, count=37), 0.002)
    steps = np.diff(arc_length(stations))
    assert np.ptp(steps) < 1e-5
    assert arc_length(stations)[-1] == pytest.approx(0.1 * np.pi, rel=1e-4)


def test_frames_are_rotations():
    frames = centreline_through(helix(0.04, 0.05, 3, 600), 0.002).frames
    np.testing.assert_allclose(
        np.einsum("sji,sjk->sik", frames, frames), np.broadcast_to(np.eye(3), frames.shape), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-9)


def test_frames_do_not_spin_about_a_plane_curve():
    # In a plane the binormal never turns, and the normals keep their angle to it.
    frames = rotation_minimising_frames(circle(0.05, turns=0.9))
    upward = frames[:, 2, 0]
    np.testing.assert_allclose(upward, upward[0], atol=1e-6)


def test_frames_turn_against_a_helix_by_its_total_torsion():
    # Against the Frenet frame a rotation-minimising frame turns by minus the integral of torsion (Bishop 1975).
    radius, pitch, turns = 0.04, 0.1, 2
    points = helix(radius, pitch, turns, 4000)
    frames = rotation_minimising_frames(points)
    inward = -points * [1, 1, 0] / radius
    angle = np.unwrap(np.arctan2((inward * frames[:, :, 1]).sum(1), (inward * frames[:, :, 0]).sum(1)))
    c = pitch / (2 * np.pi)
    torsion = c / (radius**2 + c**2) * np.hypot(radius, c) * 2 * np.pi * turns
    assert angle[-20] - angle[20] == pytest.approx(torsion, rel=0.02)


def test_curvature_of_a_circle():
    assert np.median(curvature(resample(circle(0.05), 0.002))) == pytest.approx(20, rel=1e-3)


def test_smoothing_keeps_straight_lines_and_ends():
    line = np.column_stack([np.linspace(0, 1, 200), np.zeros((200, 2))])
    np.testing.assert_allclose(smooth(line, 8.0), line, atol=1e-12)
    wiggle = line + np.column_stack([np.zeros(200), 0.01 * np.sin(np.arange(200)), np.zeros(200)])
    assert np.abs(smooth(wiggle, 8.0)[20:-20, 1]).max() < 1e-4
