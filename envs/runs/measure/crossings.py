"""Where a curve crosses itself, seen from one side."""

from collections.abc import Callable
from functools import cache
from inspect import unwrap
from typing import Any

import numpy as np
from jaxtyping import Float


def crossings(
    flat: Float[np.ndarray, "n 2"], height: Float[np.ndarray, " n"], arc: Float[np.ndarray, " n"]
) -> list[tuple[float, float, float]]:
    """Arc lengths of both strands of each crossing [m], and its sign: 1 where it is right-handed.

    Args:
        flat: the curve across the view [m].
        height: along the view [m].
        arc: along the curve [m].
    """
    return [tuple(each) for each in _compiled()(*map(np.ascontiguousarray, (flat, height, arc))).tolist()]


def _crossings(flat: Any, height: Any, arc: Any) -> np.ndarray:
    """Rows of `crossings`."""
    pieces = len(flat) - 1
    found = np.empty((16, 3))
    count = 0
    for one in range(pieces - 2):
        ax, ay = flat[one + 1, 0] - flat[one, 0], flat[one + 1, 1] - flat[one, 1]
        for other in range(one + 2, pieces):
            bx, by = flat[other + 1, 0] - flat[other, 0], flat[other + 1, 1] - flat[other, 1]
            gx, gy = flat[other, 0] - flat[one, 0], flat[other, 1] - flat[one, 1]
            turn = ax * by - ay * bx
            if turn == 0.0:
                continue
            s, t = (gx * by - gy * bx) / turn, (gx * ay - gy * ax) / turn
            if s < 0.0 or s >= 1.0 or t < 0.0 or t >= 1.0:
                continue
            if count == len(found):
                found = np.concatenate((found, np.empty_like(found)))
            mine = height[one] + s * (height[one + 1] - height[one])
            above = mine - (height[other] + t * (height[other + 1] - height[other]))
            found[count, 0] = arc[one] + s * (arc[one + 1] - arc[one])
            found[count, 1] = arc[other] + t * (arc[other + 1] - arc[other])
            found[count, 2] = np.sign(turn * above)
            count += 1
    return found[:count]


@cache
def _compiled() -> Callable[..., np.ndarray]:
    from numba import njit

    compiled: Any = njit(unwrap(_crossings), nogil=True, cache=True)
    return compiled
