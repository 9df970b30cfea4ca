"""A bent tube with haustral folds: a colon small enough to be decomposed in a second."""

import numpy as np
import pytest

from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Surface
from haustra.provenance import Provenance

RADIUS = 0.02
FOLD = 0.004
ANGLES = 32


def swept_colon(path: np.ndarray, *, name: str, bulge_at: float | None = None) -> Colon:
    """A tube of 20 mm radius with a 4 mm fold every 30 mm, along equally spaced points in the plane z = 0.

    Where it has a bulge it is 4 mm wider over some 12 mm.
    """
    step = np.linalg.norm(np.diff(path, axis=0), axis=1).mean()
    arc = np.arange(len(path)) * step
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    up = np.tile([0.0, 0.0, 1.0], (len(path), 1))
    frames = np.stack([up, np.cross(tangent, up), tangent], axis=2)
    profile = RADIUS - FOLD * np.cos(np.pi * arc / 0.030) ** 8
    if bulge_at is not None:
        profile += FOLD * np.exp(-0.5 * ((arc - bulge_at) / 0.006) ** 2)
    radius = np.tile(profile[:, None], (1, ANGLES))
    # Closed by flat ends one station beyond the centreline on either side, so that it lies inside.
    rings = [0, *range(len(path)), len(path) - 1]
    shift = np.zeros(len(rings))
    shift[0], shift[-1] = -step, step
    angle = 2 * np.pi * np.arange(ANGLES) / ANGLES
    points = []
    for ring, along in zip(rings, shift, strict=True):
        circle = np.cos(angle)[:, None] * frames[ring, :, 0] + np.sin(angle)[:, None] * frames[ring, :, 1]
        points.append(path[ring] + along * tangent[ring] + radius[ring][:, None] * circle)
    vertices = np.concatenate([*points, [points[0].mean(axis=0), points[-1].mean(axis=0)]])
    return Colon(
        name=name,
        lumen=Surface(vertices, _tube_faces(len(rings))),
        centreline=Centreline(path, arc, frames),
        radius=radius,
        segments=(ColonSegment("rectum", 0.0, float(arc[-1])),),
        provenance=Provenance(inputs={}, configuration={}),
    )


def _tube_faces(rings: int) -> np.ndarray:
    faces = []
    first, last = rings * ANGLES, rings * ANGLES + 1
    for k in range(ANGLES):
        after = (k + 1) % ANGLES
        for ring in range(rings - 1):
            a, b = ring * ANGLES + k, ring * ANGLES + after
            faces += [[a, b, b + ANGLES], [a, b + ANGLES, a + ANGLES]]
        end = (rings - 1) * ANGLES
        faces += [[first, after, k], [last, end + k, end + after]]
    return np.array(faces)


def _bend(radius: float, turn: float, straight: float) -> np.ndarray:
    """Points every 3 mm along a straight, a bend in the plane z = 0 and another straight."""
    length = 2 * straight + radius * turn
    arc = np.linspace(0.0, length, round(length / 0.003) + 1)
    heading = np.clip((arc - straight) / radius, 0.0, turn)
    step = np.diff(arc, prepend=0.0)
    return np.column_stack([np.cumsum(np.cos(heading) * step), np.cumsum(np.sin(heading) * step), np.zeros(len(arc))])


@pytest.fixture(scope="session")
def tube_colon() -> Colon:
    """A quarter turn of 40 mm radius between straights of 45 mm."""
    return swept_colon(_bend(0.040, np.pi / 2, 0.045), name="bent tube")


@pytest.fixture(scope="session")
def hairpin_colon() -> Colon:
    """Half a turn of 21 mm radius: its two straights lie 2 mm apart."""
    return swept_colon(_bend(0.021, np.pi, 0.060), name="hairpin")


@pytest.fixture(scope="session")
def nested_colon() -> Colon:
    """A hairpin in which one straight bulges against a fold of the other, with a millimetre between them."""
    return swept_colon(_bend(0.021, np.pi, 0.060), name="nested", bulge_at=0.156)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache of the test's own."""
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"
