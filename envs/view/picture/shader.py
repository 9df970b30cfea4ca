"""The mucosa's law as machine code of this processor: sixteen pixels at a time, in single precision."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.linear.memory import Rows, Shared
from haustra.envs.sim.linear.place import aligned
from haustra.envs.sim.linear.trace import Changing, Program, Value
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.mucosa import (
    Change,
    Landmark,
    Lattice,
    Looks,
    Scene,
    Sight,
    WallPlace,
    corners,
    masked,
    shade,
)
from haustra.envs.view.picture.pixels import Pixels, begun, function_of
from haustra.envs.view.picture.renderer import CameraPose, SurfaceView
from haustra.models.wall.vectors import dot

LANES = 16
"""Pixels that are shaded at a time."""
SHARED = 13
"""Numbers that all pixels of a picture share before those of guides and landmarks: axes, light's fall, the angle that a
pixel sees, the film's brightness, mucus."""
FOURS = 3
"""Rows of what is known of vertices have four times so many numbers: place at rest, arc length, what is known."""
_ARRAYS = ("common", "lattice", "wall", "faces", "lens", "own", "met", "light")
_COUNTS = ("pixels", "first", "last")


@functools.cache
def write_shader(kinds: tuple[int, ...], guides: int) -> str:
    """The program that shades blocks of pixels, in LLVM's language.

    Args:
        kinds: of the landmarks.
        guides: number of light guides.
    """
    program, given = begun("shade", _ARRAYS, _COUNTS, lanes=LANES)
    pixels, first, last = (given[name] for name in _COUNTS)
    scene = _scene(program, given, kinds, guides)
    corners_of = Shared(program, given["faces"], whole=True)
    wall = Rows(program, given["wall"], FOURS)
    with program.loop(first, last) as block:
        pixel = program.xp.minimum(block * LANES, pixels - LANES)  # the last block begins within the one before it
        lens, met, light = (Pixels(program, given[name], pixel, pixels) for name in ("lens", "met", "light"))
        own = Pixels(program, given["own"], pixel, whole=True).load()
        seen, dark = own >= 0, Value(program, program.spread(0.0))
        for band in range(3):
            light.store(dark, band)
        with program.when(seen):
            begin = program.xp.maximum(own, 0) * 3
            a, b, c = (corners_of.gather(begin + corner) for corner in range(3))
            weights = met.vector(1)
            x, y, z, *known = (
                dot(weights, (wall.read(a, column), wall.read(b, column), wall.read(c, column))) for column in range(9)
            )
            sight = Sight(met.load(0), lens.vector(0), met.vector(4), lens.load(3))
            bands = shade(
                program.xp, WallPlace((x, y, z), *known), sight, scene, functools.partial(only_where, program)
            )
            for band, value in enumerate(bands):
                light.store(program.xp.where(seen, value, 0.0), band)
    return program.finish()


class Shader:
    """Shades pictures that are seen through one lens by the same light."""

    def __init__(self, lens: Lens, light: Light) -> None:
        """Take a lens, at the size of the pictures, and the light beside it."""
        self._lens, self._pixel, self._light = lens_planes(lens), pixel_angle(lens), light

    def bind(
        self, looks: Appearance, view: SurfaceView, light: Float[np.ndarray, "3 height width"]
    ) -> Callable[[int, int], None]:
        """What shades blocks of a view's pixels, from a first one to before a last one, into `light`."""
        common = common_numbers(looks, view.pose, self._light, self._pixel)
        lattice = aligned(corners(looks.lattice), np.float32)
        arrays = common, lattice, looks.wall, view.surface.faces, self._lens, view.own, view.planes, light
        addresses = [each.ctypes.data for each in arrays]
        text = write_shader(looks.kinds, len(self._light.guides))
        _, function = function_of(text, "shade", len(_ARRAYS), len(_COUNTS))

        def work(first: int, last: int, arrays: Any = arrays) -> None:  # which stay alive with it
            function(*addresses, view.own.size, first, last)

        return work


def common_numbers(looks: Appearance, pose: CameraPose, light: Light, pixel: float) -> Float[np.ndarray, " numbers"]:
    """What all pixels of a picture share, given the angle that one sees [rad], in the order in which programs read."""
    numbers = [pose.rotation.T.ravel(), (light.spread, pixel, looks.wet, looks.mucus)]
    numbers += [np.ravel(light.guides), looks.landmarks[:, 1:].ravel()]
    return np.concatenate(numbers).astype(np.float32)


def lens_planes(lens: Lens) -> Float[np.ndarray, "4 height width"]:
    """Rays of all pixels, and the share of light that the lens lets through there, plane after plane."""
    towards = -lens.grid[..., 2:]
    dim = np.where(towards > 0, towards, 0.0) ** lens.vignetting
    return np.ascontiguousarray(np.moveaxis(np.concatenate([lens.grid, dim], axis=-1), -1, 0), np.float32)


def pixel_angle(lens: Lens) -> float:
    """Angle that a pixel in the middle of the picture sees [rad]."""
    per_radius = 0.01 / float(lens.radius(np, np.array(0.01)))
    return per_radius / float(np.sqrt(abs(np.linalg.det(lens.stretch))))


def _scene(program: Program, given: dict[str, Any], kinds: tuple[int, ...], guides: int) -> Scene:
    shared = Shared(program, given["common"])
    numbers = iter([shared.load(slot) for slot in range(SHARED + 3 * guides + 7 * len(kinds))])

    def vector() -> Any:
        return next(numbers), next(numbers), next(numbers)

    axes = vector(), vector(), vector()
    (spread, pixel, wet), mucus = vector(), next(numbers)
    places = [vector() for _ in range(guides)]
    landmarks = [Landmark(kind, vector(), next(numbers), vector()) for kind in kinds]
    return Scene(lattice_of(program, given["lattice"]), landmarks, axes, places, spread, pixel, wet, mucus)


def lattice_of(program: Program, base: Any) -> Lattice:
    """The random numbers of `haustra.envs.view.picture.mucosa.corners` in a program."""
    lattice = Rows(program, base, 1)
    return lambda row: [lattice.read(row, each) for each in range(4)]


def only_where(program: Program, condition: Value, change: Change, looks: Looks) -> Looks:
    """Looks changed where a condition holds, for what is known where it holds anywhere."""
    changing = Changing(program, looks.numbers)
    with program.when(condition):
        changing.now = masked(program.xp, condition, change, looks).numbers
    return Looks.of(changing.now)
