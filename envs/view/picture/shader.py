"""The mucosa's law as machine code of this processor: sixteen pixels at a time, in single precision."""

import ctypes
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float
from llvmlite import ir

from haustra.envs.sim.linear.compile import engine_of
from haustra.envs.sim.linear.memory import Lanes, Rows, Shared
from haustra.envs.sim.linear.place import aligned
from haustra.envs.sim.linear.trace import INDEX, Changing, Program, Value
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.mucosa import Change, Landmark, Looks, Scene, Sight, WallPlace, corners, masked, shade
from haustra.envs.view.picture.renderer import SurfaceView
from haustra.models.wall.vectors import dot

LANES = 16
"""Pixels that are shaded at a time."""
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
    kind = [ir.PointerType()] * len(_ARRAYS) + [INDEX] * len(_COUNTS)
    program = Program("shade", kind, lanes=LANES, real=np.dtype(np.float32))
    arrays: dict[str, Any] = dict(zip(_ARRAYS, program.function.args, strict=False))
    pixels, first, last = (Value(program, each) for each in program.function.args[len(_ARRAYS) :])
    scene = _scene(program, arrays, kinds, guides)
    corners_of = Shared(program, arrays["faces"], whole=True)
    wall = Rows(program, arrays["wall"], FOURS)
    with program.loop(first, last) as block:
        pixel = program.xp.minimum(block * LANES, pixels - LANES)  # the last block begins within the one before it
        lens, met, light = (_planes(program, arrays[name], pixel, pixels) for name in ("lens", "met", "light"))
        own = _triangles(program, arrays["own"], pixel)
        seen = own >= 0
        for band in range(3):
            light.store(band, 0.0)
        with program.when(seen):
            begin = program.xp.maximum(own, 0) * 3
            a, b, c = (corners_of.gather(begin + corner) for corner in range(3))
            weights = met.vector(1)
            x, y, z, *known = (
                dot(weights, (wall.read(a, column), wall.read(b, column), wall.read(c, column))) for column in range(9)
            )
            sight = Sight(met.load(0), lens.vector(0), met.vector(4), lens.load(3))
            bands = shade(program.xp, WallPlace((x, y, z), *known), sight, scene, functools.partial(_only, program))
            for band, value in enumerate(bands):
                light.store(band, program.xp.where(seen, value, 0.0))
    return program.finish()


class Shader:
    """Shades pictures that are seen through one lens by the same light."""

    def __init__(self, lens: Lens, light: Light) -> None:
        """Take a lens, at the size of the pictures, and the light beside it."""
        towards = -lens.grid[..., 2:]
        dim = np.where(towards > 0, towards, 0.0) ** lens.vignetting
        self._lens = np.ascontiguousarray(np.moveaxis(np.concatenate([lens.grid, dim], axis=-1), -1, 0), np.float32)
        self._light = light
        per_radius = 0.01 / float(lens.radius(np, np.array(0.01)))
        self._pixel = per_radius / float(np.sqrt(abs(np.linalg.det(lens.stretch))))

    def bind(
        self, looks: Appearance, view: SurfaceView, light: Float[np.ndarray, "3 height width"]
    ) -> Callable[[int, int], None]:
        """What shades blocks of a view's pixels, from a first one to before a last one, into `light`."""
        guides, places = np.array(self._light.guides), looks.landmarks
        numbers = [view.pose.rotation.T.ravel(), (self._light.spread, self._pixel, looks.wet)]
        numbers += [guides.ravel(), places[:, 1:].ravel()]
        common = np.concatenate(numbers).astype(np.float32)
        lattice = aligned(corners(looks.lattice), np.float32)
        arrays = common, lattice, looks.wall, view.surface.faces, self._lens, view.own, view.planes, light
        addresses = [each.ctypes.data for each in arrays]
        _, function = _compiled(tuple(int(kind) for kind in places[:, 0]), len(guides))

        def work(first: int, last: int, arrays: Any = arrays) -> None:  # which stay alive with it
            function(*addresses, view.own.size, first, last)

        return work


@functools.cache
def _compiled(kinds: tuple[int, ...], guides: int) -> tuple[Any, Callable[..., None]]:
    """The program's function, and what keeps it alive."""
    engine = engine_of(write_shader(kinds, guides))
    arguments = [ctypes.c_void_p] * len(_ARRAYS) + [ctypes.c_int32] * len(_COUNTS)
    return engine, ctypes.CFUNCTYPE(None, *arguments)(engine.get_function_address("shade"))


def _scene(program: Program, arrays: dict[str, Any], kinds: tuple[int, ...], guides: int) -> Scene:
    shared = Shared(program, arrays["common"])
    numbers = iter([shared.load(slot) for slot in range(12 + 3 * guides + 7 * len(kinds))])

    def vector() -> Any:
        return next(numbers), next(numbers), next(numbers)

    axes = vector(), vector(), vector()
    spread, pixel, wet = vector()
    places = [vector() for _ in range(guides)]
    landmarks = [Landmark(kind, vector(), next(numbers), vector()) for kind in kinds]
    lattice = Rows(program, arrays["lattice"], 1)

    def four(row: Any) -> list[Value]:
        return [lattice.read(row, each) for each in range(4)]

    return Scene(four, landmarks, axes, places, spread, pixel, wet)


def _planes(program: Program, base: Any, pixel: Value, apart: Value) -> Lanes:
    """Numbers of some pixels, plane after plane."""
    return Lanes(program, program.builder.gep(base, [pixel.written], source_etype=program.real), apart)


def _triangles(program: Program, base: Any, pixel: Value) -> Value:
    builder = program.builder
    place = builder.gep(base, [pixel.written], source_etype=INDEX)
    return Value(program, builder.load(place, typ=ir.VectorType(INDEX, LANES), align=4))


def _only(program: Program, condition: Value, change: Change, looks: Looks) -> Looks:
    """Looks changed where a condition holds, for what is known where it holds anywhere."""
    changing = Changing(program, looks.numbers)
    with program.when(condition):
        changing.now = masked(program.xp, condition, change, looks).numbers
    return Looks.of(changing.now)
