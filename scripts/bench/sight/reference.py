"""The endoscope's picture beside a path tracer's: rays, light straight from the guides, and light from wall to wall."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import Lens, named_lens
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.numpy_shade import matt_pixels, seen_pixels
from haustra.envs.view.picture.renderer import CameraPose, SurfaceView
from haustra.envs.view.picture.surface import ColonSurface
from haustra.models.anatomy.colon import Colon
from haustra.scripts.bench.sight.mitsuba_light import MitsubaScene, TracedRays
from haustra.scripts.bench.sight.traced_scene import MM, TracedScene, traced_scene

SEED = 5
"""Seed of the grown colon."""
LENS = "cf-hq190l"
"""Lens that pictures are seen through."""
PLACES = {"sigmoid": 0.4, "descending": 0.5, "transverse": 0.7, "ascending": 0.4}
"""Segments that are looked into, and how far along each [1]."""
ASIDE = 0.8
"""How far off the centreline the tip stands, of the way to the wall there [1]: it presses the wall out."""
TIP_RADIUS = 0.0066
"""Radius of the tip that indents the wall [m]; engineering choice: half of the CF-H190L's 13.2 mm."""
_FINEST = 1e-3
"""What is finer on the wall than this is left out of what it sends on to other wall [m]; engineering choice: about
the distance between its vertices."""
_DEEPEST = 40
"""Pieces of the longest path: red light has a thousandth of its strength left after as many [1]."""
_SHADED = 0.001
"""Pixels to which less than this share of the guides' light does not come are not in a shadow [1]; tolerance."""


class Compared(NamedTuple):
    """One place, looked at in both ways; pixels row after row."""

    scope: Endoscope
    view: SurfaceView
    rays: TracedRays
    shader: Float[np.ndarray, "pixels 3"]
    """Light by the shader."""
    matt: Float[np.ndarray, "pixels 3"]
    """By the guides' formula alone, of a matt wall that nothing shades."""
    direct: Float[np.ndarray, "pixels 3"]
    """By Mitsuba: straight from the guides."""
    traced: Float[np.ndarray, "pixels 3"]
    """By Mitsuba: from wall to wall too."""
    noise: Float[np.ndarray, "pixels 3"]
    """How far that is from either half of its samples."""

    @property
    def both(self) -> np.ndarray:
        """Pixels at which both see wall."""
        return (self.view.own >= 0).ravel() & self.rays.met


def indented_look(colon: Colon, segment: str, share: float, lens: Lens) -> tuple[Endoscope, CameraPose]:
    """An endoscope whose tip presses the wall, and its camera's pose, so far along a segment."""
    own = next(each for each in colon.segments if each.name == segment)
    arc, line = own.start + share * (own.end - own.start), colon.centreline
    station, beyond = (min(int(np.searchsorted(line.arc, at)), len(line.arc) - 1) for at in (arc, arc + 0.04))
    aside = line.frames[station][:, 0]
    place = line.points[station] + ASIDE * float(colon.radius[station, 0]) * aside
    pose = CameraPose(place, looking(line.points[beyond] - place, line.frames[station][:, 1]))
    surface = ColonSurface(colon)
    surface.make_room(place, -pose.rotation[:, 2], arc, TIP_RADIUS)
    return Endoscope(colon, lens, surface=surface), pose


def compare_place(scope: Endoscope, pose: CameraPose, *, samples: int) -> Compared:
    """Look in both ways.

    Args:
        scope: the camera, its light and the wall.
        pose: of the camera.
        samples: of each pixel by Mitsuba.

    Raises:
        MissingDependencyError: without Mitsuba.
    """
    light, view = Light(), scope.look(pose)
    scene: TracedScene = traced_scene(scope, pose, light, size=_FINEST)
    tracer, seen = MitsubaScene(scene), seen_pixels(scope.appearance, view, light)
    rays, sent = tracer.rays(), matt_pixels(seen).reshape(-1, 3)
    given = np.empty_like(scene.reflectance)
    given[view.surface.order] = scene.reflectance
    # Mitsuba knows what the wall sends back at vertices; what is seen of it is known at each pixel.
    fine = np.nan_to_num(sent / view.interpolate(given).reshape(-1, 3))
    dim = np.asarray(seen.sight.dim).reshape(-1, 1)
    places = np.where(rays.met, rays.distance, 1.0)[:, None] * scene.rays
    matt = dim * sent * scene.irradiance(places, rays.normals)[:, None]
    direct = dim * fine * tracer.direct()
    halves = [dim * fine * tracer.light(depth=_DEEPEST, samples=-(-samples // 2), seed=seed) for seed in range(2)]
    traced, noise = (halves[0] + halves[1]) / 2, np.abs(halves[0] - halves[1]) / 2
    shader = scope.radiance(view).reshape(-1, 3).astype(float)
    return Compared(scope, view, rays, shader, matt, direct, traced, noise)


def differences(found: Compared) -> dict[str, float]:
    """Numbers of one place."""
    both, view, rays = found.both, found.view, found.rays
    apart = np.abs(MM * view.distance.ravel()[both] - rays.distance[both])
    turned = np.linalg.norm(np.cross(view.normals.reshape(-1, 3)[both], rays.normals[both]), axis=1)
    shader, matt, direct, traced = (each[both] for each in (found.shader, found.matt, found.direct, found.traced))
    kept = direct.sum(axis=1) / np.maximum(matt.sum(axis=1), 1e-30)
    open_to_light, lit = kept > 1 - _SHADED, matt.sum(axis=1) > 0
    row: dict[str, float] = {
        "met_alike": float(((view.own >= 0).ravel() == rays.met)[view.lens.within.ravel()].mean()),
        "distance_median_mm": float(np.median(apart)),
        "distance_largest_mm": float(apart.max()),
        "normals_largest_deg": float(np.degrees(np.arcsin(np.minimum(turned, 1.0))).max()),
        "formula": float(np.median(np.abs(kept - 1)[open_to_light & lit])),
        "in_shadow": float((~open_to_light & lit).mean()),
        "light_in_shadow": float(1 - direct.sum() / matt.sum()),
        "shader_direct": _unlike(shader, direct),
        "shader_direct_exposed": _unlike(_exposed(shader, direct), direct),
        "shader_traced": _unlike(shader, traced),
        "shader_traced_exposed": _unlike(_exposed(shader, traced), traced),
        "traced_noise": float(found.noise[both].mean() / traced.mean()),
    }
    left = 1 - direct.sum(axis=0) / traced.sum(axis=0)
    return row | {f"from_wall_{band}": float(share) for band, share in zip(("red", "green", "blue"), left, strict=True)}


def bench_reference(
    colon: Colon,
    *,
    size: int,
    samples: int,
    places: Sequence[str] = tuple(PLACES),
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> tuple[list[tuple[str, Compared]], list[dict[str, Any]]]:
    """What is seen at some places of a colon, by their names, and numbers of each, one row each.

    Args:
        colon: grown, with segments.
        size: rows and columns of a picture.
        samples: of each pixel by Mitsuba.
        places: segments, of `PLACES`.
        progress: told places done.

    Raises:
        MissingDependencyError: without Mitsuba.
    """
    lens, seen = named_lens(LENS).at(size, size), []
    for number, segment in enumerate(places):
        seen.append((segment, compare_place(*indented_look(colon, segment, PLACES[segment], lens), samples=samples)))
        progress(number + 1, segment)
    return seen, [{"place": segment, **differences(found)} for segment, found in seen]


def _unlike(light: Float[np.ndarray, "pixels 3"], other: Float[np.ndarray, "pixels 3"]) -> float:
    """Mean absolute difference of linear light, of the other's mean [1]."""
    return float(np.abs(light - other).mean() / other.mean())


def _exposed(light: Float[np.ndarray, "pixels 3"], other: Float[np.ndarray, "pixels 3"]) -> Float[np.ndarray, "p 3"]:
    """Light with the other's mean in each band: what remains is how it is spread."""
    return light * (other.mean(axis=0) / light.mean(axis=0))
