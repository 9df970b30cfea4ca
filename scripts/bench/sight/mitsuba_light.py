"""A picture by Mitsuba 3 (Jakob and others, BSD licence): its rays, its direct light, and light from wall to wall.

Mitsuba has no calibrated fisheye and no such light guide: its path tracer is asked along the project's rays, and guides
are an emitter written here. It computes in single precision, one ray after the other, and needs no LLVM and no GPU for
that.
"""

import importlib
import importlib.util
import math
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from haustra.errors import MissingDependencyError
from haustra.scripts.bench.sight.traced_scene import TracedScene

_VARIANT = "scalar_rgb"
_GUIDE = "haustra_light_guide"


class TracedRays(NamedTuple):
    """What Mitsuba's rays meet."""

    met: Bool[np.ndarray, " pixels"]
    distance: Float[np.ndarray, " pixels"]
    """Along rays [mm]; infinite where they meet nothing."""
    normals: Float[np.ndarray, "pixels 3"]
    """Unit normals, smooth from triangle to triangle; zero where they meet nothing."""


def has_mitsuba() -> bool:
    """Whether Mitsuba is installed."""
    return importlib.util.find_spec("mitsuba") is not None


class MitsubaScene:
    """A scene in Mitsuba's hands."""

    def __init__(self, scene: TracedScene) -> None:
        """Give Mitsuba the scene.

        Raises:
            MissingDependencyError: without Mitsuba.
        """
        self._mi = mi = _mitsuba()
        properties = mi.Properties()
        properties["mesh_bsdf"] = mi.load_dict(
            {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}
        )
        mesh = mi.Mesh("wall", len(scene.vertices), len(scene.faces), has_vertex_normals=True, props=properties)
        mesh.add_attribute("vertex_color", 3, scene.reflectance.astype(np.float32).ravel())
        held = mi.traverse(mesh)
        held["vertex_positions"] = scene.vertices.astype(np.float32).ravel()
        held["vertex_normals"] = scene.normals.astype(np.float32).ravel()
        held["faces"] = scene.faces.astype(np.uint32).ravel()
        held.update()
        own = {"power": scene.power, "spread": scene.spread}
        guides = [
            mi.load_dict({"type": _GUIDE, "place": mi.ScalarPoint3f(*place), **own}) for place in scene.guides.tolist()
        ]
        self._each = [mi.load_dict({"type": "scene", "wall": mesh, "guide": guide}) for guide in guides]
        named = {f"guide_{number}": guide for number, guide in enumerate(guides)}
        self._scene = mi.load_dict({"type": "scene", "wall": mesh, **named})
        self._rays = [mi.Ray3f([0.0, 0.0, 0.0], ray) for ray in scene.rays.tolist()]

    def rays(self) -> TracedRays:
        """What the rays of all pixels meet."""
        distance, normals = np.full(len(self._rays), np.inf), np.zeros((len(self._rays), 3))
        for pixel, ray in enumerate(self._rays):
            found = self._scene.ray_intersect(ray)
            if found.is_valid():
                distance[pixel], normals[pixel] = found.t, found.sh_frame.n
        return TracedRays(np.isfinite(distance), distance, normals)

    def direct(self) -> Float[np.ndarray, "pixels 3"]:
        """Light that comes back in each pixel from a matt wall, straight from the guides; without noise."""
        parts = [self._traced(scene, depth=2, samples=1, seed=0) for scene in self._each]
        return np.sum(parts, axis=0)

    def light(self, *, depth: int, samples: int, seed: int = 0) -> Float[np.ndarray, "pixels 3"]:
        """Light that comes back in each pixel from a matt wall, from wall to wall too.

        Args:
            depth: pieces of the longest path from camera to light: 2 for light that comes straight from the guides.
            samples: of each pixel; what is found has noise, which falls as the root of their number.
            seed: of the noise.
        """
        return self._traced(self._scene, depth=depth, samples=samples, seed=seed)

    def _traced(self, scene: Any, *, depth: int, samples: int, seed: int) -> Float[np.ndarray, "pixels 3"]:
        mi = self._mi
        integrator = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 12})
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed)
        total = np.zeros((len(self._rays), 3))
        for pixel, ray in enumerate(self._rays):
            along = mi.RayDifferential3f(ray)
            for _ in range(samples):
                total[pixel] += integrator.sample(scene, sampler, along)[0]
        return total / samples


def _mitsuba() -> Any:
    """Mitsuba, with the light guide among its emitters."""
    if not has_mitsuba():
        raise MissingDependencyError(
            "Light from wall to wall needs Mitsuba: install it with 'pip install haustra[mitsuba]'."
        )
    mi: Any = importlib.import_module("mitsuba")
    if mi.variant() == _VARIANT:
        return mi
    mi.set_variant(_VARIANT)

    class LightGuide(mi.Emitter):
        """Sends exp(-mu (1 - cos)) / d^2 along the camera's axis, -z."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self._place = mi.ScalarPoint3f(properties["place"])
            self._power, self._spread = float(properties["power"]), float(properties["spread"])
            self.m_flags = mi.EmitterFlags.DeltaPosition
            self.m_needs_sample_3 = False

        def sample_direction(self, it: Any, sample: Any, active: bool = True) -> Any:
            """Straight from the guide."""
            found, way = mi.DirectionSample3f(), self._place - it.p
            square = way.x * way.x + way.y * way.y + way.z * way.z
            found.p, found.n, found.time = self._place, mi.Normal3f(0), it.time
            found.pdf, found.delta, found.emitter = 1.0, True, self
            found.dist = math.sqrt(square)
            found.d = way / found.dist
            return found, mi.Color3f(self._power * math.exp(-self._spread * (1 - found.d.z)) / square)

        def pdf_direction(self, it: Any, ds: Any, active: bool = True) -> float:
            """No other way leads to it."""
            return 0.0

        def eval(self, si: Any, active: bool = True) -> Any:
            """No ray meets it."""
            return mi.Color3f(0.0)

        def bbox(self) -> Any:
            """Its place."""
            return mi.ScalarBoundingBox3f(self._place)

    mi.register_emitter(_GUIDE, LightGuide)
    return mi
