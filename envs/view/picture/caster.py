"""Rays against triangles as machine code of this processor: eight pixels of a row at a time, in single precision."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.linear.memory import Shared
from haustra.envs.sim.linear.trace import Value, order
from haustra.envs.view.picture.pixels import Pixels, begun, function_of

LANES = 8
"""Pixels of a row that a triangle is asked about at a time: most triangles are no wider."""
PLANES = 16
"""Numbers that are kept of a triangle: see `haustra.envs.view.picture.kernels.find_boxes`."""
_ARRAYS = ("boxes", "planes", "ranges", "rays", "distance", "met")
_COUNTS = ("parts", "width", "pixels", "first", "last")


@functools.cache
def write_caster() -> str:
    """The program that holds the triangles of some stretches against some rows of pixels, in LLVM's language.

    Of a ray that meets several, the nearest stays. Nothing is reassociated or contracted: neighbours share an edge's
    product up to its sign, so that no ray slips through between them.
    """
    program, given = begun("cast", _ARRAYS, _COUNTS, lanes=LANES)
    program.flags = ()
    xp, width, pixels, first, last = program.xp, *(given[name] for name in _COUNTS[1:])
    boxes, ranges = (Shared(program, given[name], whole=True) for name in ("boxes", "ranges"))
    planes = Shared(program, given["planes"])
    beside = Value(program, order(*range(LANES)))
    with (
        program.loop(0, given["parts"]) as part,
        program.loop(ranges.load(part * 2), ranges.load(part * 2 + 1)) as triangle,
    ):
        left, right, top, bottom = (boxes.load(triangle * 4 + side) for side in range(4))
        begin, end = xp.maximum(top, first), xp.minimum(bottom + 1, last)
        with program.when(begin < end):
            p, q, r, n = (
                tuple(planes.load(triangle * PLANES + 3 * plane + axis) for axis in range(3)) for plane in range(4)
            )
            ahead = planes.load(triangle * PLANES + 12)
            with program.loop(begin, end) as row, program.loop(0, (right - left) // LANES + 1) as block:
                # Within the rows that are this thread's, also where the last pixels of a triangle end a row.
                start = xp.minimum(row * width + left + block * LANES, last * width - LANES)
                ray = Pixels(program, given["rays"], start, pixels).vector(0)
                distance, met = (
                    Pixels(program, given[name], start, whole=name == "met") for name in ("distance", "met")
                )
                nearest, pixel = distance.load(), beside + start
                way = ahead / _dot(ray, n)
                hit = (_dot(ray, p) >= 0) & (_dot(ray, q) >= 0) & (_dot(ray, r) >= 0) & (way >= 0) & (way < nearest)
                hit = hit & (pixel >= row * width + left) & (pixel <= row * width + right)
                with program.when(hit):
                    distance.store(xp.where(hit, way, nearest))
                    met.store(xp.where(hit, triangle, met.load()))
    return program.finish()


def _dot(ray: Any, plane: Any) -> Value:
    return ray[0] * plane[0] + ray[1] * plane[1] + ray[2] * plane[2]


def bind(
    boxes: Int[np.ndarray, "triangles 4"],
    planes: Float[np.ndarray, "triangles 16"],
    ranges: Int[np.ndarray, "stretches 2"],
    rays: Float[np.ndarray, "3 height width"],
    distance: Float[np.ndarray, "height width"],
    met: Int[np.ndarray, "height width"],
) -> Callable[[int, int], None]:
    """What holds triangles against the rays of some rows, from a first one to before a last one: the nearest stays.

    Args:
        boxes: as `haustra.envs.view.picture.kernels.find_boxes` left them.
        planes: see there.
        ranges: first of those kept, and after the last, of each stretch.
        rays: of all pixels, unit vectors, plane after plane.
        distance: along the ray to what is nearest so far, into which nearer ones are written [m].
        met: which of those kept that is.
    """
    arrays = boxes, planes, ranges, rays, distance, met
    addresses = [each.ctypes.data for each in arrays]
    counts = len(ranges), distance.shape[1], distance.size
    _, function = function_of(write_caster(), "cast", len(_ARRAYS), len(_COUNTS))

    def work(first: int, last: int, arrays: Any = arrays) -> None:  # which stay alive with it
        function(*addresses, *counts, first, last)

    return work
