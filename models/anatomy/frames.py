"""Curves in space: equal arc steps, tangents, rotation-minimising frames."""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from haustra.models.anatomy.colon import Centreline


def arc_length(points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
    """Arc length of each point from the first [m], along straight links."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def resample(points: Float[np.ndarray, "points 3"], step: float) -> Float[np.ndarray, "stations 3"]:
    """Points at equal arc steps of about `step` [m] on the cubic spline through `points`; both ends are kept."""
    arc = arc_length(points)
    distinct = np.concatenate([[True], np.diff(arc) > 1e-9])
    spline = CubicSpline(arc[distinct], points[distinct])
    fine = spline(np.linspace(0.0, arc[-1], 4 * len(points) + 1))
    fine_arc = arc_length(fine)
    stations = np.linspace(0.0, fine_arc[-1], max(round(fine_arc[-1] / step), 1) + 1)
    return np.stack([np.interp(stations, fine_arc, fine[:, axis]) for axis in range(3)], axis=1)


def smooth(points: Float[np.ndarray, "points 3"], sigma: float) -> Float[np.ndarray, "points 3"]:
    """Gaussian smoothing with standard deviation `sigma` [samples] that keeps both ends and their direction.

    The curve is continued beyond each end by its point reflection there, so that it neither shrinks nor bends.
    """
    pad = min(len(points) - 1, int(np.ceil(4 * sigma)))
    before = 2 * points[0] - points[pad:0:-1]
    after = 2 * points[-1] - points[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, points, after])
    return gaussian_filter1d(padded, sigma, axis=0)[pad : pad + len(points)]


def smooth_keeping_bends(points: Float[np.ndarray, "points 3"], sigma: float) -> Float[np.ndarray, "points 3"]:
    """Gaussian smoothing with standard deviation `sigma` [samples] that gives back what it took from the bends.

    Tukey's twicing (Exploratory Data Analysis, 1977, chapter 16): of a wave that the Gaussian leaves the share g,
    this leaves 1 - (1 - g)^2. A bend of radius R then loses of its length about sigma^4 / R^4, not sigma^2 / R^2.
    """
    once = smooth(points, sigma)
    return once + smooth(points - once, sigma)


def tangents(points: Float[np.ndarray, "stations 3"]) -> Float[np.ndarray, "stations 3"]:
    """Unit tangents by central differences."""
    derivative = np.gradient(points, axis=0)
    return derivative / np.linalg.norm(derivative, axis=1)[:, None]


def rotation_minimising_frames(points: Float[np.ndarray, "stations 3"]) -> Float[np.ndarray, "stations 3 3"]:
    """Frames that do not spin about the curve, by double reflection; columns are normal, second normal, tangent.

    Source: Wang, Juettler, Zheng, Liu, ACM Trans. Graph. 2008;27(1):2, doi 10.1145/1330511.1330513.
    """
    tangent = tangents(points)
    least = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    normal = np.empty_like(points)
    normal[0] = np.cross(tangent[0], least)
    normal[0] /= np.linalg.norm(normal[0])
    for i in range(len(points) - 1):
        chord = points[i + 1] - points[i]
        scale = 2.0 / (chord @ chord)
        reflected = normal[i] - scale * (chord @ normal[i]) * chord
        mirrored = tangent[i] - scale * (chord @ tangent[i]) * chord
        turn = tangent[i + 1] - mirrored
        size = turn @ turn
        if size > 0.0:
            reflected = reflected - 2.0 / size * (turn @ reflected) * turn
        reflected -= (reflected @ tangent[i + 1]) * tangent[i + 1]  # rounding must not add up over a thousand steps
        normal[i + 1] = reflected / np.linalg.norm(reflected)
    return np.stack([normal, np.cross(tangent, normal), tangent], axis=2)


def curvature(points: Float[np.ndarray, "stations 3"]) -> Float[np.ndarray, " stations"]:
    """Curvature [1/m] by central differences; points are at equal arc steps."""
    tangent = tangents(points)
    return np.linalg.norm(np.gradient(tangent, arc_length(points), axis=0), axis=1)


def centreline_through(points: Float[np.ndarray, "points 3"], step: float) -> Centreline:
    """Centreline with equal arc steps and rotation-minimising frames along a smooth curve."""
    stations = resample(points, step)
    return Centreline(points=stations, arc=arc_length(stations), frames=rotation_minimising_frames(stations))
