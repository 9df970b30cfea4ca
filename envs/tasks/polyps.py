"""Polyps that somebody may find on the way out: strewn over the mucosa of each episode, the same for all drivers.

A polyp is a hemisphere on the wall, of the size class small (6 to 9 mm) of assets/numbers/lesions.toml. It neither
stands in the scope's way nor changes what a driver is shown. It counts as found once a share of its surface was in view
at once, for so long without interruption, as assets/numbers/inspection.toml says for inspections of single runs; light,
blur and attention are left out here, so that these, too, are upper bounds.
"""

import math
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.tasks.coverage import NEAR, Camera, cameras_at_rest, half_angle_cosine, place_in_view
from haustra.envs.tasks.observation import Placed
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.sight import Stations
from haustra.models.anatomy.lesion import sizes
from haustra.models.anatomy.surface_landmarks import inspection_number
from haustra.models.wall import vectors
from haustra.models.wall.lumen_table import pick
from haustra.models.wall.moving_colon import back_to_reference
from haustra.models.wall.vectors import Vector, dot, minus, norm

EACH = 12
"""Polyps in an episode; engineering choice: they are tried for, not what a patient has."""
_PLACES = 15
"""Places on a polyp's surface, of equal area each."""
_BESIDE = 0.01
"""Farther from the camera than a polyp may be seen by this, its places need not be looked at [m];
engineering choice."""


class Polyps:
    """Polyps of many worlds, and which of them were found."""

    def __init__(self, task: ScopeTask) -> None:
        """None in any world yet."""
        self._task, self._cosine = task, half_angle_cosine(task.bank.design.tip.field_of_view_deg)
        worlds = task.worlds
        self._arc, self._size = np.full((worlds, EACH), np.inf), np.zeros((worlds, EACH))
        self._base, self._axes = np.zeros((worlds, EACH, 3)), np.zeros((worlds, EACH, 3, 3))
        self._held, self._in_view = np.zeros((worlds, EACH)), np.zeros((worlds, EACH), bool)
        self.found: Bool[np.ndarray, "worlds polyps"] = np.zeros((worlds, EACH), bool)
        self._facing = math.cos(math.radians(inspection_number("grazing")))
        self._share, self._long = inspection_number("polyp_share"), inspection_number("polyp_seen_for")

    def begin(self, world: int, case: int, seed: int) -> None:
        """Strew polyps over a world's colon, evenly by area, by the seed of its episode."""
        colon, random = self._task.bank.cases[case], np.random.default_rng([seed, EACH])
        size = sizes("polyp")["small"]
        area = colon.sight.ravel() / colon.sight.sum()
        station, column = np.divmod(random.choice(area.size, EACH, p=area), colon.sight.shape[1])
        turn = 2.0 * math.pi * column / colon.sight.shape[1]
        first, second, along = (colon.frames[station, :, axis] for axis in range(3))
        outwards = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
        self._base[world] = colon.points[station] + colon.sight[station, column][:, None] * outwards
        self._axes[world] = np.stack([along, np.cross(outwards, along), -outwards], axis=1)
        self._arc[world], self._size[world] = colon.step * station, random.uniform(size.low, size.high, EACH)
        self._held[world], self._in_view[world], self.found[world] = 0.0, False, False

    def look(self) -> None:
        """Look from where all tips are now; one control step later than the last look."""
        seen, displacement = self._task.seen, self._task.displacement
        back = None
        if displacement is not None:
            back = back_to_reference(np, pick(self._task.bank.tables, self._task.case), displacement)
        cameras = cameras_at_rest(Placed.of(seen), np.asarray(seen.tip_arc, float), back)
        away = np.linalg.norm(self._base - vectors.stacked(np, cameras.eye)[:, None], axis=2)
        world, polyp = np.nonzero(away < NEAR + _BESIDE)
        in_view = np.zeros_like(self.found)
        if len(world):
            in_view[world, polyp] = self._shown(cameras, world, polyp) >= self._share
        self._held = np.where(in_view & self._in_view, self._held + self._task.interval, 0.0)
        self._in_view = in_view
        self.found |= in_view & (self._held >= self._long)

    def _shown(
        self, cameras: Camera, world: Int[np.ndarray, " near"], polyp: Int[np.ndarray, " near"]
    ) -> Float[np.ndarray, " near"]:
        """Share of these polyps' surfaces that is in view."""
        axes, lumens = self._axes[world, polyp], self._task.sight.lumens
        normals = np.einsum("pk,nkj->npj", _dome(), axes)
        place = vectors.of(self._base[world, polyp][:, None] + self._size[world, polyp][:, None, None] / 2 * normals)
        up, left, ahead = (_each(v, world) for v in cameras.frame)
        own = Camera(_each(cameras.eye, world), (up, left, ahead), cameras.arc[world, None])
        case = self._task.case[world]
        count = lumens.count[case][:, None].astype(np.float32)
        stations = Stations(lumens.step[case][:, None], lumens.first[case][:, None], count)
        cell = place_in_view(np, lumens, stations, own, place, self._arc[world, polyp][:, None], self._cosine)
        back = minus(own.eye, place)
        faces = dot(back, vectors.of(normals)) > self._facing * norm(np, back)
        return (cell.seen & faces).mean(axis=1)


def _dome() -> Float[np.ndarray, "places 3"]:
    """Places of equal area on a hemisphere about the third axis, in a spiral."""
    count = np.arange(_PLACES) + 0.5
    height, turn = count / _PLACES, math.pi * (1 + math.sqrt(5)) * count
    aside = np.sqrt(1 - height**2)
    return np.column_stack([aside * np.cos(turn), aside * np.sin(turn), height])


def _each(v: Vector, world: Any) -> Vector:
    """A vector of some worlds, with an axis for places."""
    return v[0][world, None], v[1][world, None], v[2][world, None]
