"""The colon from outside, translucent as in an X-ray, with the scope inside it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from haustra.envs.view.picture.camera import Camera, looking, unit
from haustra.envs.view.picture.cover import add_layers, thin_wall
from haustra.envs.view.picture.raster import DepthBuffer, fragments, vertex_normals
from haustra.envs.view.picture.tube import Tube, tube
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
    view = OutsideView(lumen, rotation, width=width, height=height)
    return view.draw(scope_points, scope_radius, bending_length=bending_length)


class OutsideView:
    """A colon that stands still, to be drawn with many scopes: what does not change is worked out once."""

    def __init__(
        self,
        lumen: Surface,
        rotation: Float[np.ndarray, "3 3"],
        *,
        width: int = 900,
        height: int = 700,
        framed: Float[np.ndarray, "points 3"] | None = None,
    ) -> None:
        """Look at a colon by a camera's rotation, in a picture of that size.

        Args:
            lumen: inner surface of the colon [m].
            rotation: columns are the camera's right, up and backward directions.
            width: columns of the picture.
            height: rows of the picture.
            framed: what fits into the picture [m]; the colon when None.
        """
        self._width, self._height = width, height
        camera = _framing(lumen.vertices if framed is None else framed, rotation, width / height)
        self._canvas = _Canvas(camera, width * _SAMPLES, height * _SAMPLES)
        self._wall = _wall_of(self._canvas, lumen)
        self._empty = self._wall.over(self._canvas.background(), np.full(len(self._wall.gloss), np.inf))

    def draw(
        self, points: Float[np.ndarray, "points 3"] | None, radius: float, *, bending_length: float
    ) -> UInt8[np.ndarray, "height width 3"]:
        """The picture with a scope along `points` [m] of that radius [m] in it; None for the empty colon."""
        return self.draw_body(None if points is None else tube(points, radius, bending_length=bending_length))

    def draw_body(self, body: Tube | None) -> UInt8[np.ndarray, "height width 3"]:
        """The picture with any opaque body in it; None for the empty colon."""
        colour = self._empty
        if body is not None:
            scope = _draw_body(self._canvas, body)
            hit = np.isfinite(scope.depth)
            behind = self._wall.over(scope.colour, np.where(hit, scope.depth, -np.inf))
            colour = np.where(hit[:, None], behind, self._empty)
        shape = (self._height, _SAMPLES, self._width, _SAMPLES, 3)
        fine = np.clip(colour, 0, 1).reshape(shape).mean(axis=(1, 3))
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
class _Wall:
    """Translucent layers of all pixels, in any order."""

    pixel: Int[np.ndarray, " layers"]
    depth: Float[np.ndarray, " layers"]
    colour: Float[np.ndarray, "layers 3"]
    opacity: Float[np.ndarray, " layers"]
    weight: Float[np.ndarray, " layers"]
    """Weight of each layer's colour in its pixel: by opacity, more for near layers."""
    gloss: Float[np.ndarray, " pixels"]
    """Gloss of the nearest layer, which is added to the pixel's colour."""

    def over(
        self, below: Float[np.ndarray, "pixels 3"], limit: Float[np.ndarray, " pixels"]
    ) -> Float[np.ndarray, "pixels 3"]:
        """Colours of all pixels, given what is below, through the layers that are nearer than that."""
        count = len(self.gloss)
        total, through, sums = np.zeros(count), np.zeros(count), np.zeros((count, 3))
        add_layers(self.pixel, self.depth, self.colour, self.opacity, self.weight, limit, total, through, sums)
        let = np.exp(through)[:, None]
        return below * let + sums / np.maximum(total, 1e-12)[:, None] * (1 - let) + self.gloss[:, None]


@dataclass(frozen=True)
class _Scope:
    depth: Float[np.ndarray, " pixels"]
    colour: Float[np.ndarray, "pixels 3"]


def _draw_body(canvas: _Canvas, body: Tube) -> _Scope:
    buffer = DepthBuffer(width=canvas.width, height=canvas.height)
    colour = np.zeros((canvas.width * canvas.height, 3))
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


def _wall_of(canvas: _Canvas, lumen: Surface) -> _Wall:
    """Every layer of the colon, and the gloss of the nearest ones."""
    image, depth = canvas.project(lumen.vertices)
    normals = vertex_normals(lumen.vertices, lumen.faces)
    view = unit(canvas.camera.position - lumen.vertices)
    facing = np.sum(normals * view, axis=1)
    local = normals @ canvas.camera.rotation
    nearness = (depth.max() - depth) / np.ptp(depth)
    values = np.concatenate([depth[:, None], facing[:, None], local, nearness[:, None]], axis=1)
    front = DepthBuffer(width=canvas.width, height=canvas.height)
    parts = []
    for batch in fragments(image[lumen.faces], width=canvas.width, height=canvas.height):
        count = len(batch.pixel)
        layers = np.empty(count), np.empty((count, 3)), np.empty(count), np.empty(count)
        thin_wall(lumen.faces, values, batch.triangle, batch.weights, _LIGHT, _SHADE, _FLESH, *layers)
        front.add(batch, layers[0])
        parts.append((batch.pixel, *layers))
    hit = np.flatnonzero(np.isfinite(front.depth))
    gloss = np.zeros(canvas.width * canvas.height)
    gloss[hit] = 0.30 * np.clip(unit(front.interpolate(lumen.faces, local, hit)) @ _HALFWAY, 0, 1) ** 50
    if not parts:  # nothing of it can be seen
        none = np.zeros(0)
        return _Wall(np.zeros(0, int), none, np.zeros((0, 3)), none, none, gloss)
    pixel, own_depth, colour, opacity, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _Wall(pixel, own_depth, colour, opacity, weight, gloss)
