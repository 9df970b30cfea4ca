"""The mucosa's law at a picture's pixels and a surface's vertices by numpy, in double precision: for comparisons."""

import functools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.view.picture import mucosa
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.mucosa import Landmark, Looks, Scene, Sight, WallPlace
from haustra.envs.view.picture.renderer import SurfaceView
from haustra.envs.view.picture.shader import pixel_angle
from haustra.models.wall.vectors import of


class SeenPixels(NamedTuple):
    """What the law is given of all pixels of a view."""

    place: WallPlace
    sight: Sight
    scene: Scene


def seen_pixels(looks: Appearance, view: SurfaceView, light: Light) -> SeenPixels:
    """What the law is given of a view's pixels; of those that meet nothing, places at the origin."""
    lens = view.lens
    wall = np.empty((len(looks.wall), 12))
    wall[view.surface.order] = looks.wall
    found = np.nan_to_num(view.interpolate(wall))
    away = np.where(view.own >= 0, view.distance, 1.0)
    dim = np.maximum(-lens.grid[..., 2], 0.0) ** lens.vignetting
    place = WallPlace(of(found[..., :3]), *np.moveaxis(found[..., 3:9], -1, 0))
    sight = Sight(away, of(lens.grid), of(view.normals.astype(float)), dim)
    return SeenPixels(place, sight, _scene(looks, view.pose.rotation, light, pixel_angle(lens)))


def shade_pixels(seen: SeenPixels) -> Float[np.ndarray, "height width 3"]:
    """Light of all pixels, before exposure, as `haustra.envs.view.picture.endoscope.Endoscope.radiance` has it."""
    with np.errstate(all="ignore"):
        return np.stack(mucosa.shade(np, *seen, functools.partial(mucosa.masked, np)), axis=-1)


def matt_pixels(seen: SeenPixels) -> Float[np.ndarray, "height width 3"]:
    """Share of light that the wall sends back at all pixels, in red, green and blue, without the film of water [1]."""
    return _matt(seen.place, seen.sight.away * seen.scene.pixel, seen.scene)


def matt_vertices(looks: Appearance, size: float) -> Float[np.ndarray, "vertices 3"]:
    """Share of light that comes back at a surface's vertices, in its order [1]; what is finer than `size` [m], not."""
    wall = looks.wall.astype(float)
    place = WallPlace(of(wall[:, :3]), *wall[:, 3:9].T)
    return _matt(place, np.full(len(wall), size), _scene(looks, np.eye(3), Light(), 0.0))


def _matt(place: WallPlace, size: Float[np.ndarray, "*places"], scene: Scene) -> Float[np.ndarray, "*places 3"]:
    with np.errstate(all="ignore"):
        found: Looks = mucosa.wall_looks(np, place, size, scene, functools.partial(mucosa.masked, np))
    return np.stack(np.broadcast_arrays(*found.pale), axis=-1) * np.asarray(found.dark)[..., None]


def _scene(looks: Appearance, rotation: Float[np.ndarray, "3 3"], light: Light, pixel: float) -> Scene:
    corners = mucosa.corners(looks.lattice.astype(float))
    landmarks = [Landmark(int(row[0]), of(row[1:4]), row[4], of(row[5:8])) for row in looks.landmarks]
    axes = of(rotation[:, 0]), of(rotation[:, 1]), of(rotation[:, 2])
    about = light.guides, light.spread, pixel, looks.wet, looks.mucus
    return Scene(lambda row: np.moveaxis(corners[row], -1, 0), landmarks, axes, *about)
