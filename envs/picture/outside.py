"""The colon from outside, translucent as in an X-ray, with the scope inside it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.picture.camera import Camera, looking, unit
from haustra.envs.picture.raster import DepthBuffer, fragments, vertex_normals
from haustra.envs.picture.tube import tube
from haustra.models.anatomy.colon import Surface

_SAMPLES = 2
"""Pixels are drawn this many times finer along each side, then averaged."""
_FIELD_OF_VIEW_DEG = 24.0
_SEEN_FROM_THE_SIDE = 0.3
"""Below this share of its length in the picture's plane, the way from anus to middle does not say what is up."""
_BACKGROUND_MIDDLE, _BACKGROUND_RIM = np.array([0.985, 0.985, 0.99]), np.array([0.90, 0.915, 0.935])
_FLESH, _SHADE = np.array([0.93, 0.56, 0.53]), np.array([0.60, 0.20, 0.22])
_LIGHT = unit(np.array([-0.45, 0.65, 0.62]))
"""Direction towards the light in the camera's frame: over the viewer's left shoulder."""
_HALFWAY = unit(_LIGHT + np.array([0.0, 0.0, 1.0]))
"""Between the light and the viewer: a surface that faces this way glints."""


def default_rotation(lumen: Surface, path: Float[np.ndarray, "points 3"] | None = None) -> Float[np.ndarray, "3 3"]:
    """Camera rotation that shows most of a colon, as if one faced the patient.

    It looks along the colon's thinnest direction, with the first point of `path` (the anus) below and the last (the
    caecum, for a whole centreline) on the left.
    """
    middle = lumen.vertices.mean(axis=0)
    centred = lumen.vertices - middle
    _, axes = np.linalg.eigh(centred.T @ centred)
    thin, up = axes[:, 0], axes[:, 2]
    if path is None:
        return looking(thin, up)
    from_anus = middle - path[0]
    from_anus -= (from_anus @ thin) * thin
    if np.linalg.norm(from_anus) > _SEEN_FROM_THE_SIDE * np.linalg.norm(middle - path[0]):
        up = from_anus
    rotation = looking(thin, up)
    return looking(-thin, up) if (path[-1] - middle) @ rotation[:, 0] > 0 else rotation


def outside_view(
    lumen: Surface,
    scope_points: Float[np.ndarray, "points 3"] | None = None,
    scope_radius: float = 0.0064,
    *,
    bending_length: float = 0.10,
    rotation: Float[np.ndarray, "3 3"] | None = None,
    width: int = 900,
    height: int = 700,
) -> UInt8[np.ndarray, "height width 3"]:
    """Draw a translucent colon with an opaque scope in it.

    Args:
        lumen: inner surface of the colon [m].
        scope_points: centre line of the scope from the anus to the tip [m]; None for an empty colon.
        scope_radius: radius of the scope [m].
        bending_length: length of the bending section, which is drawn lighter [m].
        rotation: columns are the camera's right, up and backward directions; `default_rotation` when None.
        width: columns of the picture.
        height: rows of the picture.

    Returns:
        The picture, RGB.
    """
    rotation = default_rotation(lumen, scope_points) if rotation is None else rotation
    camera = _framing(lumen.vertices, rotation, width / height)
    canvas = _Canvas(camera, width * _SAMPLES, height * _SAMPLES)
    scope = _draw_scope(canvas, scope_points, scope_radius, bending_length)
    behind, before, gloss = _draw_colon(canvas, lumen, scope.depth)
    colour = canvas.background()
    colour = behind.over(colour)
    colour = np.where(np.isfinite(scope.depth)[:, None], scope.colour, colour)
    colour = before.over(colour) + gloss[:, None]
    fine = np.clip(colour, 0, 1).reshape(height, _SAMPLES, width, _SAMPLES, 3).mean(axis=(1, 3))
    return (255 * fine + 0.5).astype(np.uint8)


def _framing(vertices: np.ndarray, rotation: np.ndarray, aspect: float) -> Camera:
    """A camera far enough away that every vertex is in the picture, with a margin."""
    local = vertices @ rotation
    middle = (local.min(axis=0) + local.max(axis=0)) / 2
    half = (local.max(axis=0) - local.min(axis=0)) / 2
    reach = 1.06 * max(half[1], half[0] / aspect) / np.tan(np.radians(_FIELD_OF_VIEW_DEG) / 2)
    return Camera(rotation @ (middle + np.array([0.0, 0.0, reach + half[2]])), rotation, _FIELD_OF_VIEW_DEG)


@dataclass(frozen=True)
class _Canvas:
    camera: Camera
    width: int
    height: int

    def project(self, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.camera.perspective(vertices, width=self.width, height=self.height)

    def background(self) -> np.ndarray:
        rows, columns = np.mgrid[-1 : 1 : self.height * 1j, -1 : 1 : self.width * 1j]
        rim = np.clip((rows**2 + columns**2) / 2, 0, 1).reshape(-1, 1)
        return _BACKGROUND_MIDDLE * (1 - rim) + _BACKGROUND_RIM * rim


@dataclass(frozen=True)
class _Layers:
    """Translucent layers of one pixel in any order: summed colours weighted by opacity, and summed optical depth."""

    colour: Float[np.ndarray, "pixels 3"]
    weight: Float[np.ndarray, " pixels"]
    optical_depth: Float[np.ndarray, " pixels"]

    def over(self, below: np.ndarray) -> np.ndarray:
        through = np.exp(-self.optical_depth)[:, None]
        mean = self.colour / np.maximum(self.weight, 1e-12)[:, None]
        return below * through + mean * (1 - through)


@dataclass(frozen=True)
class _Scope:
    depth: Float[np.ndarray, " pixels"]
    colour: Float[np.ndarray, "pixels 3"]


def _draw_scope(canvas: _Canvas, points: np.ndarray | None, radius: float, bending_length: float) -> _Scope:
    buffer = DepthBuffer(width=canvas.width, height=canvas.height)
    colour = np.zeros((canvas.width * canvas.height, 3))
    if points is None:
        return _Scope(buffer.depth, colour)
    body = tube(points, radius, bending_length=bending_length)
    image, depth = canvas.project(body.vertices)
    for batch in fragments(image[body.faces], width=canvas.width, height=canvas.height):
        buffer.add(batch, np.einsum("fk,fk->f", batch.weights, depth[body.faces[batch.triangle]]))
    hit = np.flatnonzero(np.isfinite(buffer.depth))
    normals = unit(buffer.interpolate(body.faces, body.normals, hit)) @ canvas.camera.rotation
    own = buffer.interpolate(body.faces, body.colours, hit)
    diffuse = np.clip(normals @ _LIGHT, 0, 1)
    shine = np.clip(normals @ _HALFWAY, 0, 1) ** 40
    rim = (1 - np.clip(normals[:, 2], 0, 1)) ** 3
    colour[hit] = own * (0.35 + 0.75 * diffuse)[:, None] + 0.45 * shine[:, None] + 0.10 * rim[:, None]
    return _Scope(buffer.depth, colour)


def _draw_colon(canvas: _Canvas, lumen: Surface, scope_depth: np.ndarray) -> tuple[_Layers, _Layers, np.ndarray]:
    """Layers behind and before the scope, and the gloss of the nearest one."""
    image, depth = canvas.project(lumen.vertices)
    normals = vertex_normals(lumen.vertices, lumen.faces)
    view = unit(canvas.camera.position - lumen.vertices)
    facing = np.sum(normals * view, axis=1)
    local = normals @ canvas.camera.rotation
    nearness = (depth.max() - depth) / np.ptp(depth)
    values = np.concatenate([depth[:, None], facing[:, None], local, nearness[:, None]], axis=1)
    pixels = canvas.width * canvas.height
    sums = np.zeros((2, 5, pixels))
    front = DepthBuffer(width=canvas.width, height=canvas.height)
    for batch in fragments(image[lumen.faces], width=canvas.width, height=canvas.height):
        at = np.einsum("fk,fkc->fc", batch.weights, values[lumen.faces[batch.triangle]])
        front.add(batch, at[:, 0])
        opacity, colour = _layer(at)
        weight = opacity * np.exp(2.5 * at[:, 5])
        before = at[:, 0] < scope_depth[batch.pixel]
        for side in (0, 1):
            chosen = before if side else ~before
            where = batch.pixel[chosen]
            parts = (*(colour[chosen] * weight[chosen, None]).T, weight[chosen], -np.log1p(-opacity[chosen]))
            for total, part in zip(sums[side], parts, strict=True):
                np.add.at(total, where, part)
    hit = np.flatnonzero(np.isfinite(front.depth))
    gloss = np.zeros(pixels)
    gloss[hit] = 0.30 * np.clip(unit(front.interpolate(lumen.faces, local, hit)) @ _HALFWAY, 0, 1) ** 50
    behind, before_layers = (_Layers(total[:3].T, total[3], total[4]) for total in sums)
    return behind, before_layers, gloss


def _layer(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Opacity and colour of a thin wall: denser where the line of sight grazes it."""
    grazing = 1 - np.clip(np.abs(at[:, 1]), 0, 1)
    opacity = 0.10 + 0.55 * grazing**2.2
    towards = np.where(at[:, 1:2] < 0, -at[:, 2:5], at[:, 2:5])
    lit = np.clip(0.55 + 0.5 * (towards @ _LIGHT), 0, 1)[:, None]
    edge = (grazing**1.5)[:, None]
    colour = (_SHADE + (_FLESH - _SHADE) * lit) * (1 - 0.35 * edge) + 0.12 * lit
    return opacity, np.clip(colour, 0, 1)
