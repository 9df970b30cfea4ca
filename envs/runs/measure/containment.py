"""Whether the scope is still inside the colon."""

from collections.abc import Iterable, Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from haustra.models.anatomy.colon import Colon
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.sections import SHORTEST

_LARGEST_RADIUS = 0.06
"""Radii above this are looks along the lumen, not across [m]."""

_BLUR = 0.01
"""The lumen is as wide as within this stretch of centreline on either side [m]: folds are thinner."""

_PATH_STRETCH = (0.35, 2.2)
"""Least and most centreline per length of scope that a search allows: scopes cut corners and lie in loops."""
_FOLD = 0.1
"""A tip may be folded back beside so much of its scope [m], which then lies further in than it does."""
_PLEATED = 3.0
"""By how much more centreline a length of scope may have gathered where the colon moves."""


_GATHERED = 1 / SHORTEST
"""By how much more centreline a length of scope has gathered where folds lie against each other [1]."""
_STATION_STEP = 0.01
"""Distance between stations for many worlds [m]: a scope that stands out by `ESCAPE_DEPTH` seems 0.3 mm further."""


class LumenWidths(NamedTuple):
    """Stations of one colon's centreline and how wide it is there; or of several colons, or one a world, first."""

    arcs: Any
    """Arc lengths [m]."""
    width: Any
    """Largest radius of the lumen within a centimetre [m]."""


def lumen_widths(colon: Colon) -> LumenWidths:
    """Largest radius of a colon's lumen within a centimetre of each station of its centreline."""
    return widths_along(colon.centreline.arc, colon.radius)


def widths_along(arcs: Float[np.ndarray, " stations"], radius: Float[np.ndarray, "stations angles"]) -> LumenWidths:
    """Largest of radii that a lumen has at stations [m] within a centimetre of each."""
    widest = np.minimum(radius, _LARGEST_RADIUS).max(axis=1)
    reach = int(np.ceil(_BLUR / (arcs[1] - arcs[0])))
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(widest, reach, mode="edge"), 2 * reach + 1)
    return LumenWidths(arcs, windows.max(axis=1))


def station_widths(tables: Tables, colons: Iterable[LumenWidths]) -> Float[np.ndarray, " rows"]:
    """How wide each colon's lumen is at each row of the stacked tables [m]."""
    rows = zip(tables.step, tables.count, colons, strict=True)
    return np.concatenate([np.interp(step * np.arange(count), *widths) for step, count, widths in rows])


def stack_widths(colons: Sequence[Colon]) -> LumenWidths:
    """Widths of several colons, a row each, at every centimetre; a shorter one's last station fills its row up."""
    longest = max(colon.centreline.length for colon in colons)
    arcs = _STATION_STEP * np.arange(int(np.ceil(longest / _STATION_STEP)) + 1)
    rows = [lumen_widths(colon) for colon in colons]
    each = [np.minimum(arcs, row.arcs[-1]) for row in rows]
    widths = [np.interp(own, *row) for own, row in zip(each, rows, strict=True)]
    return LumenWidths(np.array(each), np.array(widths))


def outside(
    xp: ModuleType,
    widths: LumenWidths,
    stations: Float[Any, "*worlds stations 3"],
    nodes: Float[Any, "*worlds nodes 3"],
    *,
    behind: Float[Any, "*any nodes"],
    inside: Bool[Any, "*worlds nodes"],
    tip_arc: Float[Any, "*worlds"],
    radius: Any,
    moves: bool,
) -> Float[Any, "*worlds"]:
    """How far the node that is furthest out stands outside the lumen [m]; negative when all are inside.

    A bound, not a distance: the lumen is taken as round with its largest radius within a centimetre, so a scope that
    lies in a haustrum counts as inside, and one that has left through the wall is seen once it is clear of it.

    Args:
        xp: numpy or jax.numpy.
        widths: of one colon, or of one a world.
        stations: where the stations are now [m].
        nodes: points on the scopes' axes [m].
        behind: their distances from the tip along the scope [m].
        inside: which of them are past the anus: the others do not count.
        tip_arc: arc length of the tip [m].
        radius: of the scope [m].
        moves: whether the colon may gather on the scope.
    """
    tip, arcs = xp.asarray(tip_arc)[..., None, None], widths.arcs[..., None, :]
    low, high = beside(xp, tip, behind[..., None], moves=moves)
    # Beyond its ends, the first and the last station count.
    candidates = (arcs >= xp.minimum(low, arcs[..., -1:])) & (arcs <= xp.maximum(high, arcs[..., :1]))
    # One product of matrices instead of a difference for every pair: half the time of a check.
    squares = (nodes**2).sum(-1)[..., None] + (stations**2).sum(-1)[..., None, :]
    squares = squares - 2 * xp.matmul(nodes, xp.swapaxes(stations, -1, -2))
    apart = stands_out(xp, squares, widths.width[..., None, :], xp.asarray(radius)[..., None, None])
    nearest = xp.where(candidates, apart, np.inf).min(-1)
    return xp.where(inside, nearest, -np.inf).max(-1)


def skipped_colon(arc: Any, before: Any, apart: Any) -> Any:
    """Colon between two places of a scope beyond what may be gathered there [m]: a loop that the scope is not in.

    Args:
        arc: arc length of the place that is nearer to the tip [m].
        before: of the other [m].
        apart: distance between them along the scope [m].
    """
    return arc - before - _GATHERED * apart


def most_skipped(
    xp: Any, arcs: Float[Any, "*worlds links"], behind: Float[Any, "*any nodes"], inside: Bool[Any, "*worlds nodes"]
) -> Float[Any, "*worlds"]:
    """The most colon that is between the middles of neighbouring links past the anus (`skipped_colon`) [m].

    Args:
        xp: numpy or jax.numpy.
        arcs: arc lengths beside the middles of links [m].
        behind: distances of links' origins and of the tip from the tip along the scope [m].
        inside: which of those are past the anus.
    """
    middles = (behind[..., :-1] + behind[..., 1:]) / 2
    found = skipped_colon(arcs[..., 1:], arcs[..., :-1], middles[..., :-1] - middles[..., 1:])
    return xp.where(inside[..., :-2], found, 0.0).max(-1)


def furthest_ahead(tip_arc: Any) -> Any:
    """No point of a scope is further in than this, whose tip is at that arc length [m]."""
    return tip_arc + _FOLD + _BLUR


def beside(xp: Any, tip_arc: Any, behind: Any, *, moves: bool) -> tuple[Any, Any]:
    """Between which arc lengths a point of a scope can be, so far behind a tip at that arc length [m].

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        tip_arc: [m].
        behind: distance from the tip along the scope [m].
        moves: whether the colon may gather on the scope.
    """
    least, most = _PATH_STRETCH
    ahead = xp.minimum(behind, _FOLD) - least * xp.maximum(behind - _FOLD, 0.0)
    return tip_arc - (most * _PLEATED if moves else most) * behind - _BLUR, tip_arc + ahead + _BLUR


def stands_out(xp: Any, square: Any, width: Any, radius: Any) -> Any:
    """How far a scope of that radius, the root of `square` from the axis of a lumen that wide, stands outside [m]."""
    return xp.sqrt(xp.maximum(square, 0.0)) - width + radius


class Containment:
    """Measures how far a scope stands outside one colon's lumen: `outside`, at every station of its centreline."""

    def __init__(self, colon: Colon, *, radius: float) -> None:
        """For a scope of that radius [m]."""
        self._points, self._widths, self._radius = colon.centreline.points, lumen_widths(colon), radius

    def outside(
        self,
        nodes: Float[np.ndarray, "nodes 3"],
        behind: Float[np.ndarray, " nodes"],
        tip_arc: float,
        way: Float[np.ndarray, "stations 3"] | None = None,
    ) -> float:
        """How far the node that is furthest out stands outside the lumen [m]; negative when all are inside.

        Args:
            nodes: points on the scope's axis inside the patient [m].
            behind: their distances from the tip along the scope [m].
            tip_arc: arc length of the tip [m].
            way: where the centreline's stations are now [m], when the colon has moved.
        """
        arcs, width = self._widths
        if not len(nodes):
            return -float(width.min() - self._radius)
        passed = slice(0, max(1, int(np.searchsorted(arcs, furthest_ahead(tip_arc), side="right"))))
        found = outside(
            np,
            LumenWidths(arcs[passed], width[passed]),
            (self._points if way is None else way)[passed],
            nodes,
            behind=behind,
            inside=np.ones(len(nodes), bool),
            tip_arc=np.float64(tip_arc),
            radius=np.float64(self._radius),
            moves=way is not None,
        )
        return float(found)
