"""A picture's scene as a path tracer takes it: surface, what its wall sends back, camera's rays and light guides.

In millimetres, in the camera's axes (right, up, backwards) with the camera at the origin: there single precision is
finest, and a tracer's steps off a surface are smallest. Light is that of `haustra.envs.view.picture.light`, of guides
that together send one unit straight ahead at 1 m, so that radiance is in the units of
`haustra.envs.view.picture.endoscope.Endoscope.radiance`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.numpy_shade import matt_vertices
from haustra.envs.view.picture.renderer import CameraPose

MM = 1e3
"""Millimetres in a metre [mm/m]; by definition."""


@dataclass(frozen=True)
class TracedScene:
    """Numbers alone: no tracer is needed to make one."""

    vertices: Float[np.ndarray, "vertices 3"]
    """Places of the surface's vertices [mm]."""
    faces: Int[np.ndarray, "triangles 3"]
    """Corners, counter-clockwise as seen from the lumen."""
    normals: Float[np.ndarray, "vertices 3"]
    """Unit normals into the lumen: means of the triangles' around, by area."""
    reflectance: Float[np.ndarray, "vertices 3"]
    """Share of red, green and blue light that a matt wall sends back [1]."""
    rays: Float[np.ndarray, "pixels 3"]
    """Unit vectors of all pixels, row after row."""
    guides: Float[np.ndarray, "guides 3"]
    """Places of the light guides [mm]."""
    power: float
    """Radiant intensity of each straight ahead, in light at 1 mm: pi over their number, times a million."""
    spread: float
    """mu of exp(-mu (1 - cos)) [1]."""

    def irradiance(
        self, places: Float[np.ndarray, "pixels 3"], normals: Float[np.ndarray, "pixels 3"]
    ) -> Float[np.ndarray, " pixels"]:
        """Light of all guides on places [mm] of a matt wall that nothing shades, over pi."""
        total = np.zeros(len(places))
        for guide in self.guides:
            way = guide - places
            square = (way * way).sum(axis=-1)
            way = way / np.sqrt(square)[:, None]
            falls = np.exp(-self.spread * (1 - way[:, 2])) / square
            total += falls * np.maximum((way * normals).sum(axis=-1), 0.0)
        return self.power / np.pi * total


def traced_scene(scope: Endoscope, pose: CameraPose, light: Light, *, size: float) -> TracedScene:
    """The scene that an endoscope looks at from a pose, where its surface is now.

    Args:
        scope: the camera and the colon's wall.
        pose: of the camera.
        light: at the tip.
        size: what is finer on the wall than this is left out of its reflectance [m].
    """
    surface = scope.surface
    for stretch in range(surface.count):
        surface.bring(stretch)
    vertices = MM * (surface.vertices - pose.position) @ pose.rotation
    faces = np.ascontiguousarray(surface.faces[:, ::-1])
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], np.cross(b - a, c - a))
    return TracedScene(
        vertices=vertices,
        faces=faces,
        normals=normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30),
        reflectance=np.clip(matt_vertices(scope.appearance, size), 0.0, 1.0),
        rays=scope.renderer.lens.grid.reshape(-1, 3),
        guides=MM * np.array(light.guides),
        power=np.pi / len(light.guides) * MM**2,
        spread=light.spread,
    )
