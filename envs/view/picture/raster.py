"""Triangles to pixels in numpy: what a picture needs where there is no OpenGL."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

_CANDIDATES = 1 << 20  # pixel tests at a time: bounds the memory to some 100 MB


@dataclass(frozen=True)
class Fragments:
    """Where triangles cover pixel centres."""

    pixel: Int[np.ndarray, " fragments"]
    """Row times width plus column."""
    triangle: Int[np.ndarray, " fragments"]
    """Index of the covering triangle."""
    weights: Float[np.ndarray, "fragments 3"]
    """Barycentric coordinates of the pixel centre, for interpolating values of the corners."""


def fragments(corners: Float[np.ndarray, "triangles 3 2"], *, width: int, height: int) -> Iterator[Fragments]:
    """Cover pixels with triangles, in batches.

    Args:
        corners: image positions (column, row) [pixels] of each triangle's corners; pixel (i, j) has its centre at
            (j + 0.5, i + 0.5). Triangles with a corner that is not finite are left out.
        width: columns of the image.
        height: rows of the image.

    Yields:
        Batches that together hold every covered pixel of every triangle once.
    """
    low = np.ceil(np.min(corners, axis=1) - 0.5)
    high = np.floor(np.max(corners, axis=1) - 0.5)
    seen = np.isfinite(corners).all(axis=(1, 2))
    with np.errstate(invalid="ignore"):
        low = np.maximum(low, 0.0)
        high = np.minimum(high, np.array([width - 1.0, height - 1.0]))
        seen &= (low <= high).all(axis=1)
    visible = np.flatnonzero(seen)
    first = low[visible].astype(np.int64)
    size = high[visible].astype(np.int64) - first + 1
    # Triangles of like size share one grid of candidate pixels.
    side = np.maximum(1, 2 ** np.ceil(np.log2(size.max(axis=1, initial=1))).astype(np.int64))
    for extent in np.unique(side):
        members = np.flatnonzero(side == extent)
        batch = max(1, _CANDIDATES // int(extent) ** 2)
        for start in range(0, len(members), batch):
            chosen = members[start : start + batch]
            yield _cover(corners, visible[chosen], first[chosen], size[chosen], int(extent), width)


def _cover(
    corners: np.ndarray, triangle: np.ndarray, first: np.ndarray, size: np.ndarray, extent: int, width: int
) -> Fragments:
    """Test every pixel of each triangle's bounding box."""
    step = np.arange(extent)
    column, row = first[:, 0, None] + step, first[:, 1, None] + step
    a, b, c = np.moveaxis(corners[triangle], 1, 0)
    twice_area = _cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        # A barycentric coordinate is linear in column and row: one outer sum each.
        at_b = _linear(a, c - a, column, row, -1.0 / twice_area)
        at_c = _linear(a, b - a, column, row, 1.0 / twice_area)
        at_a = 1.0 - at_b - at_c
        inside = (at_a >= 0.0) & (at_b >= 0.0) & (at_c >= 0.0)
    inside &= (step < size[:, 1, None])[:, :, None] & (step < size[:, 0, None])[:, None, :]
    which, down, across = np.nonzero(inside)
    return Fragments(
        pixel=row[which, down] * width + column[which, across],
        triangle=triangle[which],
        weights=np.stack([at_a[inside], at_b[inside], at_c[inside]], axis=1),
    )


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _linear(origin: np.ndarray, edge: np.ndarray, column: np.ndarray, row: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Cross product of `edge` with the way from `origin` to each pixel centre, times `scale`."""
    x = column + 0.5 - origin[:, 0, None]
    y = row + 0.5 - origin[:, 1, None]
    return scale[:, None, None] * (edge[:, 0, None, None] * y[:, :, None] - edge[:, 1, None, None] * x[:, None, :])


class DepthBuffer:
    """The nearest fragment of each pixel."""

    def __init__(self, *, width: int, height: int) -> None:
        self.depth = np.full(width * height, np.inf)
        """Distance of the nearest fragment; infinite where there is none."""
        self.triangle = np.full(width * height, -1)
        """Its triangle; -1 where there is none."""
        self.weights = np.zeros((width * height, 3))
        """Its barycentric coordinates."""

    def add(self, batch: Fragments, depth: Float[np.ndarray, " fragments"]) -> None:
        """Keep each fragment that is nearer than what its pixel holds."""
        np.minimum.at(self.depth, batch.pixel, depth)
        nearest = np.flatnonzero(depth == self.depth[batch.pixel])
        hit = batch.pixel[nearest]
        self.triangle[hit] = batch.triangle[nearest]
        self.weights[hit] = batch.weights[nearest]

    def interpolate(
        self, faces: Int[np.ndarray, "triangles 3"], values: Float[np.ndarray, "vertices ..."], hit: np.ndarray
    ) -> np.ndarray:
        """Values of the corners, interpolated at the pixels `hit`."""
        corners = values[faces[self.triangle[hit]]]
        return np.einsum("pk,pk...->p...", self.weights[hit], corners)


def vertex_normals(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "triangles 3"]
) -> Float[np.ndarray, "vertices 3"]:
    """Unit normals, the area-weighted mean of the triangles around each vertex."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    weighted = np.cross(b - a, c - a)
    total = np.stack(
        [np.bincount(faces.ravel(), np.repeat(weighted[:, axis], 3), len(vertices)) for axis in range(3)], axis=1
    )
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
