"""What the endoscopist sees: the lumen from the tip camera, lit by the tip's own lamps."""

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.view.picture import mucosa
from haustra.envs.view.picture.camera import Camera, unit
from haustra.envs.view.picture.raster import DepthBuffer, fragments, vertex_normals
from haustra.models.anatomy.colon import Surface

_SAMPLES = 2
"""Pixels are drawn this many times finer along each side, then averaged, unless asked otherwise."""
_LAMPS = np.array([[-0.004, 0.0, 0.0], [0.004, 0.0, 0.0]])
"""Two light guides beside the lens, in the camera's frame [m]."""
_NEAR = 0.006
"""Distance below which a lamp's light no longer grows [m]: lamps are not points."""
_FAR = 0.5
"""Distance beyond which the lamps show nothing [m]."""
_BRIGHT = 0.72
"""Brightness that the camera's automatic exposure gives the 80th percentile of the picture."""
_DEEP_TINT = np.array([0.80, 0.42, 0.34])
"""Light that reaches the depth of the lumen has been scattered by tissue: it is redder."""


def tip_view(
    lumen: Surface,
    position: Float[np.ndarray, "3"],
    rotation: Float[np.ndarray, "3 3"],
    field_of_view_deg: float = 140.0,
    *,
    size: int = 480,
    samples: int = _SAMPLES,
) -> UInt8[np.ndarray, "size size 3"]:
    """Draw the inside of the lumen through a fisheye lens.

    The wall is drawn where it is seen from inside, so that a tip that has pressed a little way into a soft wall does
    not look at its outside.

    Args:
        lumen: inner surface of the colon [m].
        position: optical centre [m].
        rotation: columns are the camera's right, up and backward directions (MuJoCo's convention: it looks along -z).
        field_of_view_deg: full angle over the diameter of the picture [degrees].
        size: rows and columns of the picture.
        samples: pixels are drawn this many times finer along each side, then averaged.

    Returns:
        The picture, RGB; black outside the lens's circle and where no light comes back.
    """
    camera = Camera(position, rotation, field_of_view_deg)
    fine = size * samples
    buffer, faces = _nearest_wall(lumen, camera, fine)
    inside_circle = _circle(fine)
    hit = np.flatnonzero(np.isfinite(buffer.depth) & (inside_circle > 0))
    picture = np.zeros((fine * fine, 3))
    if len(hit):
        normals = vertex_normals(lumen.vertices, lumen.faces)
        points = buffer.interpolate(faces, lumen.vertices, hit)
        outwards = unit(buffer.interpolate(faces, normals, hit))
        picture[hit] = _tone(_light(points, -outwards, camera))
    picture *= inside_circle[:, None]
    mean = picture.reshape(size, samples, size, samples, 3).mean(axis=(1, 3))
    return (255 * np.clip(mean, 0, 1) + 0.5).astype(np.uint8)


def _nearest_wall(lumen: Surface, camera: Camera, fine: int) -> tuple[DepthBuffer, np.ndarray]:
    """The nearest wall of each pixel, and the triangles that the buffer's indices count."""
    corners = lumen.vertices[lumen.faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ahead = corners[:, 0] - camera.position
    seen = np.flatnonzero((np.sum(facing * ahead, axis=1) > 0) & (np.sum(ahead**2, axis=1) < _FAR**2))
    image, distance = camera.fisheye(lumen.vertices, size=fine)
    buffer = DepthBuffer(width=fine, height=fine)
    faces = lumen.faces[seen]
    for batch in fragments(image[faces], width=fine, height=fine):
        buffer.add(batch, np.einsum("fk,fk->f", batch.weights, distance[faces[batch.triangle]]))
    return buffer, faces


def _light(points: np.ndarray, inwards: np.ndarray, camera: Camera) -> np.ndarray:
    """Light that comes back from the wall to the camera, before exposure."""
    towards_camera = camera.position - points
    distance = np.linalg.norm(towards_camera, axis=1)
    towards_camera /= distance[:, None]
    wet = unit(inwards + 0.10 * mucosa.ripple(points))
    tissue = mucosa.colour(points)
    total = np.zeros_like(points)
    for lamp in _LAMPS:
        to_lamp = camera.position + camera.rotation @ lamp - points
        away = np.linalg.norm(to_lamp, axis=1)
        to_lamp /= away[:, None]
        power = 1.0 / (away**2 + _NEAR**2)
        # Half the light enters the tissue and leaves it elsewhere, which softens the edge of shade.
        diffuse = np.clip((np.sum(unit(inwards + 0.05 * (wet - inwards)) * to_lamp, axis=1) + 0.25) / 1.25, 0, 1)
        gloss = np.clip(np.sum(wet * unit(to_lamp + towards_camera), axis=1), 0, 1) ** 220
        total += power[:, None] * (tissue * diffuse[:, None] + 1.1 * gloss[:, None])
    depth = np.clip(distance / 0.12, 0, 1)[:, None]
    return total * (1 - depth + depth * _DEEP_TINT)


def _tone(light: np.ndarray) -> np.ndarray:
    """Automatic exposure, then a film-like curve that keeps glare from clipping."""
    brightness = light.max(axis=1)
    exposure = -np.log(1 - _BRIGHT) / max(float(np.percentile(brightness, 80)), 1e-9)
    return (1 - np.exp(-exposure * light)) ** (1 / 1.15)


def _circle(fine: int) -> np.ndarray:
    """1 inside the lens's picture, fading to 0 over its last few per cent."""
    steps = (np.arange(fine) + 0.5) / fine * 2 - 1
    radius = np.hypot(steps[:, None], steps[None, :]).ravel()
    return np.clip((0.995 - radius) / 0.03, 0, 1)
