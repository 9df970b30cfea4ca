"""Triangles to pixels: what a picture needs where there is no OpenGL."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.view.picture.cover import cover, keep_nearest

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
    boxes = np.cumsum(size.prod(axis=1))
    start = 0
    while start < len(visible):  # one triangle at least, and as many more as the bound allows
        before = boxes[start - 1] if start else 0
        end = max(int(np.searchsorted(boxes, before + _CANDIDATES, side="right")), start + 1)
        part = slice(start, end)
        yield Fragments(*cover(corners, visible[part], first[part], size[part], width, int(boxes[end - 1] - before)))
        start = end


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
        parts = batch.pixel, depth, batch.triangle, batch.weights
        keep_nearest(self.depth, self.triangle, self.weights, *parts)

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
