"""What is exactly known of each pixel of a picture: depth, normals, flow, occlusion, and what it shows."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from haustra.envs.view.dataset.formats import DEPTH_MM, TO_C3VD
from haustra.envs.view.dataset.moments import Moment
from haustra.envs.view.picture.appearance import Appearance, Residue
from haustra.envs.view.picture.endoscope import Endoscope, exposed_shares
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.light import Response
from haustra.envs.view.picture.renderer import CameraPose, RayRenderer, SurfaceView
from haustra.envs.view.picture.surface import LumenSurface
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.lesion_surface import lesion_of_triangles
from haustra.models.anatomy.surface_landmarks import landmark_of_points

_SAME_LOOP = 0.1
"""Wall farther along the colon than this from the wall in front of it is of another loop, and does not occlude [m]."""
_BEHIND = 5e-4
"""A place was hidden in the picture before when it lay so far behind all four pixels around it [m]."""


@dataclass(frozen=True)
class GroundTruth:
    """One picture's exact values; axes of the camera are C3VD's: right, down, ahead."""

    view: SurfaceView
    """What its rays meet."""
    normals: Float[np.ndarray, "height width 3"]
    """Unit normals of the triangles, towards the camera; NaN where there is nothing."""
    flow: Float[np.ndarray, "height width 2"]
    """Where what a pixel shows was in the picture before, columns and rows, less where it is [pixels]; NaN where it was
    hidden or outside, and in the first picture."""
    occluding: Bool[np.ndarray, "height width"]
    """Whether there is more wall of the same stretch behind a pixel's, within C3VD's largest depth."""
    segment: Int[np.ndarray, "height width"]
    """Index in `SEGMENTS`; -1 for none."""
    landmark: Int[np.ndarray, "height width"]
    """Index in `surface_landmarks.LANDMARKS`; -1 for none."""
    polyp: Int[np.ndarray, "height width"]
    """Index in the colon's lesions; -1 for none, and for lesions that are no polyps."""


class TruthRenderer:
    """Renders the ground truth of pictures that follow each other."""

    def __init__(
        self,
        colon: Colon,
        arcs: Float[np.ndarray, " vertices"],
        lens: Lens,
        *,
        response: Response | None = None,
        residue: Residue | None = None,
    ) -> None:
        """Take a colon at rest.

        Args:
            colon: the colon.
            arcs: arc length of each vertex of its surface [m].
            lens: of the camera.
            response: of the camera; automatic exposure without noise and blur when None.
            residue: on the wall; none when None.
        """
        self._colon, self._arcs, self._lens = colon, arcs, lens
        surface, self._response = LumenSurface(colon.lumen, arcs), response or Response()
        looks = Appearance(colon, surface, residue=residue)
        self._scope = Endoscope(colon, lens, surface=surface, appearance=looks, response=self._response)
        self._front = self._scope.renderer
        self._behind = RayRenderer(Surface(colon.lumen.vertices, colon.lumen.faces[:, ::-1]), lens)
        kinds = np.array([lesion.kind == "polyp" for lesion in colon.lesions] + [False])
        lesions = lesion_of_triangles(colon)
        self._polyps = np.append(np.where(kinds[lesions], lesions, -1), -1)
        self._borders = [segment.end for segment in colon.segments[:-1]]
        self._names = np.array([SEGMENTS.index(segment.name) for segment in colon.segments])

    def look(self, vertices: Float[np.ndarray, "vertices 3"], pose: CameraPose) -> SurfaceView:
        """What a picture's rays meet, of a surface whose vertices are there [m]."""
        self._front.place(vertices)
        return self._front.look(pose)

    def bleed(self, blood: Float[np.ndarray, "places 4"]) -> None:
        """Let pictures show blood from now on around places of the wall at rest, as far as said beside each [m]."""
        for *place, reach in blood:
            self._scope.appearance.bleed(np.array(place), float(reach))

    def picture(
        self, view: SurfaceView, *, seed: int = 0, around: tuple[Moment, Moment] | None = None
    ) -> UInt8[np.ndarray, "height width 3"]:
        """What a picture shows in colour, with noise of that seed.

        Args:
            view: what its rays meet, in the middle of its exposure.
            seed: of its noise.
            around: how things were when exposure began and ended, for motion blur; none when None.
        """
        light = self._scope.radiance(view)
        if around is not None:
            (first, begun), (last, ended) = around
            parts = [
                self._scope.radiance(self.look(first + share * (last - first), begun.towards(ended, share)))
                for share in exposed_shares()
            ]
            light = np.mean(parts, axis=0)
        return self._scope.develop(light, seed=seed)

    def truth(self, view: SurfaceView, before: SurfaceView | None) -> GroundTruth:
        """All that is known of a picture.

        Args:
            view: what its rays meet.
            before: that of the picture before, if there was one.
        """
        hit = view.triangle >= 0
        rest, arcs = view.interpolate(self._colon.lumen.vertices), view.interpolate(self._arcs)
        segment, landmark = np.full(hit.shape, -1), np.full(hit.shape, -1)
        segment[hit] = self._names[np.searchsorted(self._borders, arcs[hit], side="right")]
        landmark[hit] = landmark_of_points(self._colon, rest[hit], arcs[hit])
        return GroundTruth(
            view=view,
            normals=triangle_normals(view),
            flow=np.full((*hit.shape, 2), np.nan) if before is None else flow_between(view, before),
            occluding=self._occluding(view, arcs),
            segment=segment,
            landmark=landmark,
            polyp=self._polyps[view.triangle],
        )

    def _occluding(self, view: SurfaceView, arcs: np.ndarray) -> Bool[np.ndarray, "height width"]:
        """A ray that comes back into the lumen meets the backs of triangles: those of what lies behind."""
        self._behind.place(view.vertices)
        back = self._behind.look(view.pose)
        near = np.abs(back.interpolate(self._arcs) - arcs) < _SAME_LOOP
        return near & (back.distance > view.distance) & (1e3 * back.depth <= DEPTH_MM)


def triangle_normals(view: SurfaceView) -> Float[np.ndarray, "height width 3"]:
    """Unit normals of the triangles that rays meet, towards the camera, in C3VD's axes; NaN where there are none."""
    corners = view.vertices[view.faces[view.triangle]]
    normals = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    normals = normals @ view.pose.rotation
    normals *= -np.sign((normals * view.lens.grid).sum(-1, keepdims=True))
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-300)
    return np.where(view.triangle[..., None] >= 0, normals * TO_C3VD, np.nan)


def flow_between(view: SurfaceView, before: SurfaceView) -> Float[np.ndarray, "height width 2"]:
    """Where what each pixel shows was seen before, less where it is seen [pixels]; NaN where it was not seen.

    Places go along with the wall. Whether one was hidden is told by the four pixels around it: within a pixel.
    """
    height, width = view.triangle.shape
    away = (view.interpolate(before.vertices) - before.pose.position) @ before.pose.rotation
    pixels = view.lens.pixels(np, away)
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    low = np.nan_to_num(np.floor(pixels), nan=-1.0).astype(int)
    within = (low >= 0).all(-1) & (low[..., 0] < width - 1) & (low[..., 1] < height - 1) & (view.triangle >= 0)
    around = np.zeros(view.triangle.shape)
    for across, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        row, column = (np.where(within, low[..., axis] + more, 0) for axis, more in ((1, down), (0, across)))
        around = np.maximum(around, np.where(before.triangle[row, column] >= 0, before.distance[row, column], 0.0))
    seen = within & (np.linalg.norm(away, axis=-1) <= around + _BEHIND)
    return np.where(seen[..., None], pixels - np.stack([columns, rows], axis=-1), np.nan)
