"""Pictures from all tips at once, in colour and distance, where the physics of linear time is: on a CPU or a GPU.

The wall is the lumen's table (`haustra.envs.view.picture.lumen_rays`), with the normals and the looks of the surface
that is made of it, so that pictures are those of `haustra.envs.tasks.pictures` but for how the wall goes between the
table's numbers.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.cameras import CameraProgram, no_views
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.case import TabulatedColon
from haustra.envs.tasks.sight import RANGE
from haustra.envs.view.picture import mucosa
from haustra.envs.view.picture.appearance import Appearance, Residue
from haustra.envs.view.picture.launch import CpuLauncher, GpuLauncher, Launcher
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.light import Light, Response
from haustra.envs.view.picture.lumen_rays import FAR
from haustra.envs.view.picture.picture_program import (
    DEVELOP,
    LANES,
    LOOK,
    PLACES,
    RANKS,
    SPARSE,
    STATION_ROW,
    TILE,
    write_develop,
    write_look,
    write_places,
    write_ranks,
)
from haustra.envs.view.picture.shader import lens_planes, pixel_angle
from haustra.envs.view.picture.surface import LumenSurface
from haustra.models.wall.signed_distance import surface_arcs

_AROUND = 0.02
"""Axes of colons that move are worked out so much farther than rays go [m]; engineering choice."""
_NOWHERE = 1e3
"""Landmarks of colons that have none are as far away [m]; engineering choice: out of sight."""


class _Wall(NamedTuple):
    """What is known of one colon's wall at each station and angle."""

    known: Float[np.ndarray, "stations angles 8"]
    """Normal into the lumen, and the columns of `haustra.envs.view.picture.mucosa`."""
    places: Float[np.ndarray, "places 4"]
    """Where the surface's vertices at stations and angles are at rest, and arc lengths beside them [m]."""
    lids: Float[np.ndarray, "2 8"]
    """Numbers alike of the middles of the lids at its anus and its end."""
    looks: Appearance


class TipPictures:
    """Draws what is before the tips of all worlds of one backend."""

    def __init__(
        self,
        bank: ColonSet,
        backend: LinearBackend,
        size: int,
        *,
        threads: int = 1,
        residue: Residue | None = None,
    ) -> None:
        """Lay out the colons' walls; programs are compiled with the first pictures.

        Args:
            bank: the colons that the backend steps.
            backend: the backend.
            size: rows and columns of a picture.
            threads: of a CPU.
            residue: what lies on walls.
        """
        self._backend, self._worlds, self._size = backend, backend.worlds, size
        self._launcher: Launcher = (
            GpuLauncher() if backend.on_device else CpuLauncher(LANES, min(threads, self._worlds))
        )
        lens, light, response = lens_of(bank.design.tip, size, size), Light(), Response()
        walls = [_wall(case, residue) for case in bank.cases]
        self._kinds = tuple(int(kind) for kind in max((wall.looks.landmarks for wall in walls), key=len)[:, 0])
        self._guides, self._angles, self._target = len(light.guides), bank.cases[0].sight.shape[1], response.target
        looks = walls[0].looks
        common = [light.spread, pixel_angle(lens), looks.wet, looks.mucus, *np.ravel(light.guides)]
        planes = np.concatenate([lens_planes(lens), lens.within[None]]).reshape(5, -1)
        nodes = 0 if backend.tables.mesentery is None else backend.tables.mesentery.nodes.shape[1]
        lanes = max(self._launcher.lanes, LANES)
        self._columns, pixels, self._nodes = -(-size // SPARSE), size * size, nodes
        samples = -(-(self._columns**2) // lanes) * lanes
        blocks = -(-self._worlds // 32) * 32
        real = {
            "stations": _stations(bank.cases),
            "corners": np.concatenate([_corners(case.sight).reshape(-1, 4) for case in bank.cases]),
            "places": np.concatenate([wall.places for wall in walls]),
            "known": np.concatenate([wall.known.reshape(-1, 8) for wall in walls]),
            "landmarks": np.concatenate([_landmarks(wall, len(self._kinds)) for wall in walls]),
            "lattice": mucosa.corners(looks.lattice),
            "common": np.array(common),
            "lens": planes,
            "light": np.zeros((self._worlds, 3, pixels)),
            "distance": np.zeros((self._worlds, pixels)),
            "bright": np.zeros((self._worlds, samples)),
            "edges": np.ones((self._worlds, 4)),
        }
        self._held: dict[str, Any] = {name: self._launcher.hold(each.astype(np.float32)) for name, each in real.items()}
        self._held["curve"] = self._launcher.hold(response.curve().astype(np.int32))
        self._held["pictures"] = self._launcher.hold(np.zeros((self._worlds, size, size, 4), np.uint8))
        self._samples, self._pixels, self._curve_length = samples, pixels, len(response.curve())
        self._views = backend.hold(no_views(nodes, blocks))
        self._program = CameraProgram(reach=FAR + _AROUND)

    def draw(self) -> None:
        """Draw all worlds' pictures, as they are now."""
        self._backend.look_by(self._program, self._views)
        lanes, worlds, held = self._launcher.lanes, self._worlds, self._held
        blocks, of_samples = -(-self._pixels // lanes), self._samples // lanes
        views = self._views.run(written=True) if self._backend.on_device else self._views.read()
        about = {"kinds": self._kinds, "guides": self._guides, "angles": self._angles, "reach": RANGE}
        about["tiled"] = lanes == 1 and self._size % max(TILE) == 0
        text = write_look(lanes=lanes, moving=self._nodes > 0, **about)
        arrays = [views, *(held[name] for name in LOOK[1:])]
        self._launcher.run("look", text, arrays, (blocks, self._pixels, self._nodes, self._size), worlds)
        counts = of_samples, self._samples, self._columns**2, self._columns, self._size, self._pixels
        self._run("measure", write_places(lanes=lanes), PLACES[0], counts)
        self._run("rank", write_ranks(lanes=lanes), RANKS[0], (of_samples, self._samples))
        text = write_develop(lanes=lanes, target=self._target, reach=RANGE)
        self._run("develop", text, DEVELOP[0], (blocks, self._pixels, self._curve_length))

    def _run(self, name: str, text: str, arrays: tuple[str, ...], counts: tuple[int, ...]) -> None:
        self._launcher.run(name, text, [self._held[each] for each in arrays], counts, self._worlds)

    @property
    def in_place(self) -> Any:
        """The pictures (worlds, size, size, 4) where they lie: bytes of red, green, blue and distance over `RANGE`."""
        return self._held["pictures"]

    def both(self) -> UInt8[np.ndarray, "worlds size size 4"]:
        """Draw, and copy the pictures: red, green, blue, and distance over `RANGE`; zero where all is black."""
        self.draw()
        return self._launcher.fetch(self._held["pictures"])

    @property
    def distance(self) -> Float[np.ndarray, "worlds size size"]:
        """Distances of the last pictures, as far as `RANGE` [m]."""
        return self._launcher.fetch(self._held["distance"]).reshape(-1, self._size, self._size)


def _wall(case: TabulatedColon, residue: Residue | None) -> _Wall:
    """Normals and looks of the surface of `TabulatedColon.colon`, whose first vertices are the table's places."""
    colon = case.colon()
    arcs = surface_arcs(colon)
    surface = LumenSurface(colon.lumen, arcs)
    looks = Appearance(colon, surface, residue=residue)
    vertices, faces = colon.lumen.vertices, colon.lumen.faces
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], -np.cross(b - a, c - a))
    known = np.empty((len(vertices), 8))
    known[:, :3] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    known[surface.order, 3:] = looks.known
    count = case.sight.size
    places = np.column_stack([vertices, arcs])[:count]
    return _Wall(known[:count].reshape(*case.sight.shape, 8), places, known[count:], looks)


def _stations(cases: tuple[TabulatedColon, ...]) -> Float[np.ndarray, "stations 16"]:
    """Place and axes of each station, and which colon it is of."""
    rows = [np.zeros((len(case.points), STATION_ROW, 4)) for case in cases]
    for colon, (own, case) in enumerate(zip(rows, cases, strict=True)):
        own[:, 0, :3], own[:, 0, 3] = case.points, colon
        own[:, 1:, :3] = np.swapaxes(case.frames, 1, 2)
    return np.concatenate(rows).reshape(-1, 4 * STATION_ROW)


def _corners(sight: Float[np.ndarray, "stations angles"]) -> Float[np.ndarray, "stations angles 4"]:
    """Distance to the wall at each station and angle, the next angle, and both at the next station [m]."""
    after = np.concatenate([sight[1:], sight[-1:]])
    return np.stack([sight, np.roll(sight, -1, axis=1), after, np.roll(after, -1, axis=1)], axis=-1)


def _landmarks(wall: _Wall, count: int) -> Float[np.ndarray, "rows 8"]:
    """Place, half breadth and long axis of the landmarks of a colon, or of none, and behind them its lids."""
    rows = np.tile([_NOWHERE, 0.0, 0.0, 1e-6, 1.0, 0.0, 0.0, 0.0], (count, 1))
    if len(wall.looks.landmarks):
        rows[:, :7] = wall.looks.landmarks[:, 1:]
    return np.concatenate([rows, wall.lids])
