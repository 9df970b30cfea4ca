"""The laws of `lumen_table` and `moving_colon` in loops that numba compiles: for steps of MuJoCo, one world at a time.

Python's own lock is not held in them. All arrays have a leading axis of worlds but the tables' own; results are written
into arrays that are given. Numba keeps what it has compiled until a law changes. On one busy core 142 points are looked
up in 0.07 ms (numpy: 0.9 ms), and a step of a moving colon of 153 nodes with as many points takes 0.15 ms (7 ms).
"""

import hashlib
from collections.abc import Callable
from functools import cache
from inspect import unwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haustra.models.wall import (
    contact_solver,
    indentation,
    law,
    lumen_table,
    moving_colon,
    plane_pose,
    planes,
    sections,
    surroundings,
    threads,
    unfolding,
    vectors,
)
from haustra.models.wall import loops as loops_law
from haustra.models.wall.indentation import FALL, JUMP_COST, JUMP_FREE, JUMP_MOST, NEAR, crossed, reached, top
from haustra.models.wall.law import soft_numbers
from haustra.models.wall.loops import MARGIN, STALE, apart, contact, nearer, nearness, touch_force
from haustra.models.wall.lumen_table import axis_point, query_point
from haustra.models.wall.moving_colon import (
    bend_stiffness,
    edge_resistance,
    edge_tension,
    gas_thrust,
    grip_resistance,
    hold_force,
    lean_grip,
    lean_resistance,
    node_cell,
    node_resistance,
    node_turn_resistance,
    packed_bend,
    packed_resistance,
    wall_bend,
)
from haustra.models.wall.plane_pose import as_plane_sees, moving_contact, plane_turn
from haustra.models.wall.planes import AWAY
from haustra.models.wall.sections import (
    brought_along,
    carried,
    carried_rate,
    cell_closing,
    cell_closing_gradient,
    cell_closing_rate,
    cell_closing_reach,
    flattening,
    flattening_rate,
    flattening_reach,
    held_at,
    node_closing,
    node_closing_rate,
    section_gradient,
    taken_back,
    touched,
    turned,
    twist,
    twisted,
)
from haustra.models.wall.signed_distance import ANUS
from haustra.models.wall.surroundings import breath, envelope_force
from haustra.models.wall.threads import RING, lumen_radius, ring_force, threaded_arc
from haustra.models.wall.unfolding import aside, span
from haustra.models.wall.vectors import add, between, cross, dot, minus, norm, times, unit_rate

ROOM = 0.01
"""A plane is parked while its sphere has more room than this [m]: two steps at 1 m/s, well above any motion here."""


class Loops(NamedTuple):
    """What is compiled."""

    query: Callable[..., None]
    query_moved: Callable[..., None]
    place_planes: Callable[..., None]
    pressed: Callable[..., None]
    contacts: Callable[..., None]
    step_axis: Callable[..., None]
    thread: Callable[..., bool]
    shape: Callable[..., None]
    carry: Callable[..., None]
    way: Callable[..., None]
    along: Callable[..., Any]
    indent: Callable[..., None]
    lift: Callable[..., None]
    stands_between: Callable[..., bool]
    unfold: Callable[..., None]
    solve: Callable[..., int]


def _node(values: Any, world: int, node: int) -> Any:
    return values[world, node, 0], values[world, node, 1], values[world, node, 2]


def _put(values: Any, world: int, node: int, v: Any) -> None:
    values[world, node, 0], values[world, node, 1], values[world, node, 2] = v


def _put_more(values: Any, world: int, node: int, v: Any) -> None:
    values[world, node, 0] += v[0]
    values[world, node, 1] += v[1]
    values[world, node, 2] += v[2]


def _turn(values: Any, world: int, node: int, first: int) -> Any:
    part = values[world, node, first + 1], values[world, node, first + 2], values[world, node, first + 3]
    return values[world, node, first], part


def _put_turn(values: Any, world: int, node: int, first: int, turn: Any) -> None:
    values[world, node, first] = turn[0]
    values[world, node, first + 1], values[world, node, first + 2], values[world, node, first + 3] = turn[1]


def _section(shape: Any, world: int, node: int) -> Any:
    turn = _turn(shape.turns, world, node, 0)
    return turn[0], turn[1], shape.flats[world, node], _node(shape.acrosses, world, node)


def _cells(values: Any, world: int, node: int) -> Any:
    """Vectors of the cells before and after a node; at the ends the one there is, twice."""
    return _node(values, world, max(node - 1, 0)), _node(values, world, min(node, values.shape[1] - 1))


def _rest_closing(own: Any, world: int, at: int) -> Any:
    before, after = _node(own.tangents, world, at), _node(own.tangents, world, at + 1)
    return cell_closing(np, before, after, own.lengths[world, at])


def _node_between(values: Any, world: int, at: int, share: float) -> Any:
    return between(_node(values, world, at), _node(values, world, at + 1), share)


def _query(tables: Any, worlds: Any, points: Any, arcs: Any, depth: Any, inwards: Any) -> None:
    """Look up the points of these worlds; `arcs` are those of the last look, and then of this one."""
    step, first, count = tables.step, tables.first, tables.count
    for world in worlds:
        for p in range(points.shape[1]):
            arcs[world, p], depth[world, p], normal = query_point(
                np,
                tables,
                step[world, 0],
                first[world, 0],
                count[world, 0],
                _node(points, world, p),
                arcs[world, p],
                np.inf,
            )
            _put(inwards, world, p, normal)


def _shape(own: Any, worlds: Any, pose: Any, shape: Any) -> None:
    """How the axes of these worlds lie, into `shape`."""
    last = pose.shape[1] - 1
    for world in worlds:
        for i in range(last):
            nodes = minus(_node(own.nodes, world, i + 1), _node(own.nodes, world, i))
            edge = add(nodes, minus(_node(pose, world, i + 1), _node(pose, world, i)))
            length = norm(np, edge)
            shape.lengths[world, i] = length
            _put(shape.units, world, i, times(1 / length, edge))
        for i in range(last + 1):
            total = _node(shape.units, world, min(i, last - 1))
            if 0 < i < last:
                total = add(total, _node(shape.units, world, i - 1))
            length = norm(np, total)
            tangent = times(1 / length, total)
            shape.sums[world, i] = length
            _put(shape.tangents, world, i, tangent)
            turn = brought_along(np, _turn(pose, world, i, 3), _node(own.tangents, world, i), tangent)
            _put_turn(shape.turns, world, i, 0, turn)
        for i in range(last):
            before, after = _node(shape.tangents, world, i), _node(shape.tangents, world, i + 1)
            _put(shape.closings, world, i, cell_closing(np, before, after, shape.lengths[world, i]))
        for i in range(last + 1):
            before, after = _cells(shape.closings, world, i)
            turn = _turn(shape.turns, world, i, 0)
            at_rest = turned(turn[0], turn[1], _node(own.closings, world, i))
            flat, across = flattening(
                np, node_closing(before, after, _node(shape.tangents, world, i)), at_rest, own.widths[world, i]
            )
            shape.flats[world, i] = flat
            _put(shape.acrosses, world, i, across)


def _carry(
    pose: Any, shape: Any, at: Any, share: Any, still: Any, lever: Any, axes: Any, first: int, last: int, out: Any
) -> None:
    """Some places of the first world's colon, where they are now (`moving_colon.to_current`), in other axes.

    Args:
        pose: of the nodes.
        shape: `_shape` of them.
        at: node before each place.
        share: of the way to the next.
        still: the axis beside each place at rest (1, places, 3) [m].
        lever: from there to the place at rest (1, places, 3) [m].
        axes: columns, and as a fourth the origin: where the colon's coordinates lie in those of `out`.
        first: of the places that are wanted.
        last: after the last of them.
        out: places [m].
    """
    for p in range(first, last):
        node, part, v = at[p], share[p], _node(lever, 0, p)
        before, after = carried(_section(shape, 0, node), v), carried(_section(shape, 0, node + 1), v)
        moved = add(_node_between(pose, 0, node, part), between(before, after, part))
        x, y, z = add(_node(still, 0, p), moved)
        for i in range(3):
            out[p, i] = axes[i, 0] * x + axes[i, 1] * y + axes[i, 2] * z + axes[i, 3]


def _way(pose: Any, at: Any, share: Any, line: Any, axes: Any, way: Any) -> None:
    """Stations of the first world's centreline, where they are now.

    Args:
        pose: of the nodes.
        at: node before each station.
        share: of the way to the next.
        line: stations at rest [m].
        axes: columns: those of the nodes' coordinates in the stations'.
        way: stations [m], into which they are written.
    """
    for s in range(len(at)):
        part, before, after = share[s], _node(pose, 0, at[s]), _node(pose, 0, at[s] + 1)
        x, y, z = add(times(1 - part, before), times(part, after))
        for i in range(3):
            way[s, i] = line[s, i] + (axes[i, 0] * x + axes[i, 1] * y + axes[i, 2] * z)


def _along(path: Any, stations: Any, step: float, apart: float, radius: float) -> Any:
    """Places every `apart` [m] of a device's axis from the anus on, with those that stations were jumped over from.

    Args:
        path: the axis (1, nodes, 3) [m].
        stations: of the centreline (1, stations, 3) [m].
        step: distance between them along the centreline [m].
        apart: see there.
        radius: of the device [m].

    Returns:
        Places (places, 3) [m], the station beside each, and how far from it the tent over it stands [m].
    """
    nodes = path.shape[1]
    behind = np.zeros(nodes)
    for node in range(1, nodes):
        edge = minus(_node(path, 0, node), _node(path, 0, node - 1))
        behind[node] = behind[node - 1] + np.sqrt(dot(edge, edge))
    parts = int(np.ceil(behind[-1] / apart))
    own, found, edge = np.empty((1, parts + 1, 3)), np.zeros(parts + 1, np.int64), 0
    for p in range(parts + 1):
        here = p * (behind[-1] / max(parts, 1))
        while edge < nodes - 2 and behind[edge + 1] <= here:
            edge += 1
        for i in range(3):
            slope = (path[0, edge + 1, i] - path[0, edge, i]) / (behind[edge + 1] - behind[edge])
            own[0, p, i] = path[0, nodes - 1, i] if p == parts else path[0, edge, i] + slope * (here - behind[edge])
    _follow(own, stations, step, found)
    count = 1
    for p in range(1, parts + 1):
        count += max(found[p] - found[p - 1], 1)
    places, beside, tops, n = np.empty((count, 3)), np.empty(count, np.int64), np.empty(count), 0
    for p in range(parts + 1):
        many = max(found[p] - found[p - 1], 1) if p else 1
        for station in range(found[p] - many + 1, found[p] + 1):
            for i in range(3):
                places[n, i] = own[0, p, i]
            beside[n], tops[n] = station, top(np, minus(_node(own, 0, p), _node(stations, 0, station)), radius)
            n += 1
    return places, beside, tops


def _follow(places: Any, stations: Any, step: float, found: Any) -> None:
    """Stations of a centreline (1, stations, 3) beside places that follow each other from its beginning to a tip.

    Of all ways along the stations the one on which squares of distances, and what jumps cost, sum to the least
    (Viterbi 1967): where a device has left a bend both ways, the next place is behind the bend's loop. Ways are left
    out that end where the best way so far would be for less, by a jump from its own end.

    Args:
        places: (1, places, 3) [m].
        stations: [m].
        step: distance between stations along the centreline [m].
        found: of each place, into which they are written.
    """
    many, count = len(found), stations.shape[1]
    free, most, jump = max(int(JUMP_FREE / step), 1), int(JUMP_MOST / step), JUMP_COST * step
    came, cost, best = np.empty((many, count), np.int32), np.empty(count), np.empty(count)
    cost[0], nearest, first, last = 0.0, 0, 0, 1  # ways end from the first to before the last
    longest = 0.0
    for s in range(1, count):
        longest = max(longest, norm(np, minus(_node(stations, 0, s), _node(stations, 0, s - 1))))
    for p in range(many):
        here, low, high = _node(places, 0, p), max(nearest - most, 0), min(nearest + most + 1, count)
        first, last = max(first, low), min(last, high)
        inner, outer = max(first - free, low), min(last + free, high)
        for s in range(inner, outer):
            best[s], came[p, s] = cost[s] if first <= s < last else np.inf, s
            for other in range(max(s - free, first), min(s + free + 1, last)):
                if cost[other] < best[s]:
                    best[s], came[p, s] = cost[other], other
        for s in range(inner + 1, outer):
            if best[s - 1] + jump < best[s]:
                best[s], came[p, s] = best[s - 1] + jump, came[p, s - 1]
        for s in range(outer - 2, inner - 1, -1):
            if best[s + 1] + jump < best[s]:
                best[s], came[p, s] = best[s + 1] + jump, came[p, s + 1]
        least = np.inf
        for s in range(inner, outer):
            away = minus(_node(stations, 0, s), here)
            cost[s] = best[s] + dot(away, away)
            if cost[s] < least:
                least, nearest = cost[s], s
        first, last = inner, outer
        for way in (-1, 1):
            edge, left = (outer - 1, high - outer) if way > 0 else (inner, inner - low)
            bound, s = np.sqrt(max(least + jump * abs(edge - nearest) - best[edge], 0.0)), edge
            while left > 0:
                away = minus(_node(stations, 0, s + way), here)
                far = np.sqrt(dot(away, away))
                if far < bound:
                    s, left = s + way, left - 1
                    first, last = min(first, s), max(last, s + 1)
                    cost[s], came[p, s] = best[edge] + jump * abs(s - edge) + far * far, came[p, edge]
                    if cost[s] < least:
                        least, nearest = cost[s], s
                else:  # no nearer than that before so many more stations
                    for _ in range(min(max(int((far - bound) / longest), 0) + 1, left)):
                        s, left = s + way, left - 1
                        cost[s] = np.inf
        while first < nearest and cost[first] >= least + jump * (nearest - first):
            first += 1
        while last > nearest + 1 and cost[last - 1] >= least + jump * (last - 1 - nearest):
            last -= 1
    at = nearest
    for p in range(many - 1, -1, -1):
        found[p] = at
        at = came[p, at]


def _indent(
    places: Any, at: Any, tops: Any, arcs: Any, middles: Any, radius: float, first: int, last: int, vertices: Any
) -> None:
    """Move some vertices of a surface out of a device's way (`indentation.reached`).

    Args:
        places: of the device's axis (1, places, 3) [m].
        at: arc length of each [m].
        tops: how far from the centreline its tent stands there [m] (`indentation.tops`).
        arcs: of each vertex [m].
        middles: place of the centreline beside each vertex (1, vertices, 3) [m].
        radius: of the device [m].
        first: of the vertices.
        last: after the last of them.
        vertices: (1, vertices, 3) [m], in place.
    """
    for v in range(first, last):
        middle, here = _node(middles, 0, v), _node(vertices, 0, v)
        ray = minus(here, middle)
        length = norm(np, ray)
        ray = times(1 / length, ray)
        far = length
        if arcs[v] > ANUS:  # the lid there is no wall: the device comes in through it
            for p in range(len(at)):
                most = tops[p] - FALL * abs(at[p] - arcs[v])
                if most > far:
                    far = max(far, min(reached(np, minus(_node(places, 0, p), middle), ray, radius), most))
        if far > length:
            _put(vertices, 0, v, add(middle, times(far, ray)))


def _lift(faces: Any, arcs: Any, places: Any, at: Any, beside: Any, radius: float, vertices: Any) -> None:
    """Move triangles that still stand between the centreline and a device out along the way there.

    Their corners may be too far apart to be near the device themselves.

    Args:
        faces: corners of each triangle.
        arcs: of each vertex [m].
        places: of the device's axis (1, places, 3) [m].
        at: arc length of each [m].
        beside: place of the centreline beside each (1, places, 3) [m].
        radius: of the device [m].
        vertices: (1, vertices, 3) [m], in place.
    """
    deepest = at.max() + NEAR
    for t in range(len(faces)):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        low, high = min(arcs[i], arcs[j], arcs[k]), max(arcs[i], arcs[j], arcs[k])
        if low > deepest or low <= ANUS:
            continue
        for p in range(len(at)):
            if low - NEAR < at[p] < high + NEAR:
                axis = _node(beside, 0, p)
                ray = minus(_node(places, 0, p), axis)
                far = norm(np, ray)
                ray = times(1 / far, ray)
                a, b = minus(_node(vertices, 0, i), axis), minus(_node(vertices, 0, j), axis)
                stands = crossed(ray, a, b, minus(_node(vertices, 0, k), axis))
                if 0 < stands < far + radius:
                    way = times(far + radius - stands, ray)
                    _put_more(vertices, 0, i, way)
                    _put_more(vertices, 0, j, way)
                    _put_more(vertices, 0, k, way)


def _stands_between(vertices: Any, faces: Any, starts: Any, ends: Any) -> bool:
    """Whether a triangle stands between any two places.

    Args:
        vertices: of a surface (1, vertices, 3) [m].
        faces: corners of each triangle.
        starts: the places (1, places, 3) [m].
        ends: what is seen from each (1, places, 3) [m].
    """
    for p in range(starts.shape[1]):
        start = _node(starts, 0, p)
        ray = minus(_node(ends, 0, p), start)
        far = norm(np, ray)
        if far == 0:
            continue
        ray = times(1 / far, ray)
        for t in range(len(faces)):
            a, b = (minus(_node(vertices, 0, faces[t, 0]), start), minus(_node(vertices, 0, faces[t, 1]), start))
            if 0 < crossed(ray, a, b, minus(_node(vertices, 0, faces[t, 2]), start)) < far:
                return True
    return False


def _unfold(faces: Any, axes: Any, least: Any, looks: int, rounds: int, vertices: Any) -> None:
    """Move corners of triangles that face their axis and are not to (`unfolding.aside`), one triangle after the other.

    All triangles are looked at, and then those that turned, or have a corner that moved, until none of them faces its
    axis: further from time to time.

    Args:
        faces: corners of each triangle.
        axes: place of the centreline beside each (1, triangles, 3) [m].
        least: what each is to span as seen from there [m^3]; not looked at where it is negative.
        looks: at all triangles, at most.
        rounds: around those that turned, after each look, at most.
        vertices: (1, vertices, 3) [m], in place.
    """
    moved, busy = np.zeros(vertices.shape[1], np.bool_), np.empty(len(faces), np.int64)
    for _ in range(looks):
        turned, count = 0, 0
        moved[:] = False
        for t in range(len(faces)):
            if least[t] > 0 and _spread(faces, axes, least, 1.0, vertices, moved, t):
                turned += 1
        if turned == 0:
            break
        for t in range(len(faces)):
            if least[t] > 0 and (moved[faces[t, 0]] or moved[faces[t, 1]] or moved[faces[t, 2]]):
                busy[count] = t
                count += 1
        for number in range(rounds):
            again = False
            for b in range(count):
                again |= _spread(faces, axes, least, 1 + number / 10, vertices, moved, busy[b])
            if not again:
                break


def _spread(faces: Any, axes: Any, least: Any, times_least: float, vertices: Any, moved: Any, t: int) -> bool:
    """Spread a triangle if it faces its axis, to so many times what it is to span at least; whether it did."""
    i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
    axis = _node(axes, 0, t)
    a, b = minus(_node(vertices, 0, i), axis), minus(_node(vertices, 0, j), axis)
    c = minus(_node(vertices, 0, k), axis)
    now = span(a, b, c)
    if now > 0:
        return False
    ways = aside(np, a, b, c, times_least * least[t] - now)
    _put_more(vertices, 0, i, ways[0])
    _put_more(vertices, 0, j, ways[1])
    _put_more(vertices, 0, k, ways[2])
    moved[i], moved[j], moved[k] = True, True, True
    return True


def _rates(own: Any, world: int, speed: Any, shape: Any, spins: Any, flats: Any, acrosses: Any) -> None:
    """How fast the sections of a world turn and flatten; what is written has worlds first, of which there is one."""
    nodes = speed.shape[1]
    tangents, closings = np.empty((1, nodes, 3)), np.empty((1, nodes - 1, 3))
    for i in range(nodes):
        total = _edge_rate(shape, speed, world, min(i, nodes - 2))
        if 0 < i < nodes - 1:
            total = add(total, _edge_rate(shape, speed, world, i - 1))
        tangent = _node(shape.tangents, world, i)
        rate = unit_rate(tangent, shape.sums[world, i], total)
        _put(tangents, 0, i, rate)
        _put(spins, 0, i, add(cross(tangent, rate), times(speed[world, i, 3], tangent)))
    for i in range(nodes - 1):
        length = shape.lengths[world, i]
        longer = dot(_node(shape.units, world, i), minus(_node(speed, world, i + 1), _node(speed, world, i)))
        now = _node(shape.tangents, world, i), _node(shape.tangents, world, i + 1)
        rates = _node(tangents, 0, i), _node(tangents, 0, i + 1)
        _put(closings, 0, i, cell_closing_rate(np, now[0], now[1], length, rates[0], rates[1], longer))
    for i in range(nodes):
        before, after = _cells(shape.closings, world, i)
        rate_before, rate_after = _cells(closings, 0, i)
        tangent = _node(shape.tangents, world, i)
        turn = _turn(shape.turns, world, i, 0)
        at_rest = turned(turn[0], turn[1], _node(own.closings, world, i))
        flat, across = flattening_rate(
            np,
            node_closing(before, after, tangent),
            at_rest,
            own.widths[world, i],
            node_closing_rate(before, after, tangent, rate_before, rate_after, _node(tangents, 0, i)),
            cross(_node(spins, 0, i), at_rest),
        )
        flats[0, i] = flat
        _put(acrosses, 0, i, across)


def _query_moved(
    tables: Any,
    own: Any,
    worlds: Any,
    pose: Any,
    speed: Any,
    shape: Any,
    radius: float,
    threaded: bool,
    points: Any,
    arcs: Any,
    depth: Any,
    inwards: Any,
    lever: Any,
    wall_speed: Any,
) -> None:
    """`_query` where the axes have moved; and where spheres of that radius hold on to the wall, and its speed there.

    Those that are `threaded` follow each other on a shaft, from its end to its tip.
    """
    _shape(own, worlds, pose, shape)
    step, first, count = tables.step, tables.first, tables.count
    nodes = pose.shape[1]
    spins, flats, acrosses = np.empty((1, nodes, 3)), np.empty((1, nodes)), np.empty((1, nodes, 3))
    for world in worlds:
        _rates(own, world, speed, shape, spins, flats, acrosses)
        one, begin, end = step[world, 0], first[world, 0], count[world, 0]
        upto = np.inf
        for p in range(points.shape[1]):
            arc = arcs[world, p]
            most = np.inf
            if threaded and p:
                apart = norm(np, minus(_node(points, world, p), _node(points, world, p - 1)))
                most = threaded_arc(np, np.inf, upto, apart)
            upto = arc
            axis = axis_point(np, tables, one, begin, end, arc)
            at, share = node_cell(np, own.spacing[world], nodes, arc)
            offset = minus(minus(_node(points, world, p), axis), _node_between(pose, world, at, share))
            back = taken_back(
                np,
                offset,
                shape.lengths[world, at] / own.lengths[world, at],
                (_node(own.tangents, world, at), _node(own.tangents, world, at + 1)),
                (_rest_closing(own, world, at), _node(shape.closings, world, at)),
                _section(shape, world, at),
                _section(shape, world, at + 1),
                share,
            )
            rest = add(axis, back)
            arc, deep, normal = query_point(np, tables, one, begin, end, rest, arc, most)
            arcs[world, p] = arc
            at, share = node_cell(np, own.spacing[world], nodes, arc)
            before, after = _section(shape, world, at), _section(shape, world, at + 1)
            deep, normal, surface = touched(np, deep, normal, radius, before, after, share)
            depth[world, p] = deep
            _put(inwards, world, p, normal)
            along = _node(own.tangents, world, at), _node(own.tangents, world, at + 1)
            offset = minus(rest, axis_point(np, tables, one, begin, end, arc))
            held = held_at(offset, surface, along, share)
            _put(lever, world, p, held)
            if arc > 0:
                moved = between(
                    carried_rate(before, (_node(spins, 0, at), flats[0, at], _node(acrosses, 0, at)), held),
                    carried_rate(after, (_node(spins, 0, at + 1), flats[0, at + 1], _node(acrosses, 0, at + 1)), held),
                    share,
                )
                _put(wall_speed, world, p, add(_node_between(speed, world, at, share), moved))
            else:
                _put(wall_speed, world, p, (0.0, 0.0, 0.0))


def _place_planes(
    worlds: Any,
    points: Any,
    depth: Any,
    inwards: Any,
    wall_speed: Any,
    radius: float,
    stiffness: Any,
    stiffens: bool,
    ahead: Any,
    inverse_inertia: Any,
    h: float,
    mocap: Any,
    geoms: Any,
    pairs: Any,
    position: Any,
    turn: Any,
    margin: Any,
    solref: Any,
    sliding: Any,
    solimp: Any,
    surface: Any,
) -> None:
    """Put a plane beside each sphere where its wall is, and give its surface the wall's speed.

    MuJoCo's contact acts half-way between both outlines, so the plane only touches a sphere that is in the wall, and
    how deep it is is the pair's margin, from which MuJoCo's spring counts.

    The speed along the wall is what its friction sees; that along its normal is in the contact (`moving_contact`).
    Where the wall stiffens with depth, depth and stiffness are those of its spring there.
    """
    moves = surface.shape[0] > 0
    for world in worlds:
        for p in range(points.shape[1]):
            normal, speed, into = _node(inwards, world, p), _node(wall_speed, world, p), depth[world, p]
            away = radius + max(-into, 0.0) if into >= -ROOM else AWAY
            pair = pairs[p]
            margin[world, pair] = max(into, 0.0)
            plane = mocap[p]
            _put(position, world, plane, minus(_node(points, world, p), times(away, normal)))
            cosine, about = plane_turn(np, normal)
            turn[world, plane, 0] = cosine
            turn[world, plane, 1], turn[world, plane, 2], turn[world, plane, 3] = about
            if moves:
                _put(surface, world, geoms[p], as_plane_sees(cosine, about, speed))
            if moves or stiffens:
                margin[world, pair], damped = moving_contact(np, into, normal, speed, ahead[world], h)
                own = stiffness[world, p]
                impedance, solref[world, pair, 0], solref[world, pair, 1], sliding[world, pair, 1] = soft_numbers(
                    inverse_inertia[p], own, own * damped, h
                )
                solimp[world, pair, 0], solimp[world, pair, 1] = impedance, impedance


def _pressed(
    worlds: Any,
    felt: Any,
    first: Any,
    seen: Any,
    spheres: Any,
    points: Any,
    inwards: Any,
    wall_speed: Any,
    tread_speed: Any,
    stiffness: Any,
    ahead: Any,
    least_slip: float,
    h: float,
    load: Any,
    force: Any,
    damping: Any,
) -> None:
    """Sum up what MuJoCo's contacts did to walls in the last step, as sensors tell, and take spheres to where they are.

    Args:
        worlds: which.
        felt: what the sensors tell (`haustra.models.wall.planes.add_felt`).
        first: column of each sphere's.
        seen: places of all geoms now [m].
        spheres: geoms of the spheres.
        points: places of the spheres before the last step [m], which become those seen.
        inwards: normals of the planes there.
        wall_speed: their speed [m/s].
        tread_speed: of the spheres' surfaces against the spheres [m/s].
        stiffness: K of each sphere [N/m].
        ahead: c / K + h [s].
        least_slip: friction damps as where it slides at least so fast [m/s].
        h: time step [s].
        load: normal force of each sphere, into which it is written [N].
        force: on the wall, into which it is written [N].
        damping: along the normal and across it [N s/m].
    """
    for world in worlds:
        for p in range(points.shape[1]):
            here, normal, column = _node(seen, world, spheres[p]), _node(inwards, world, p), first[p]
            speed = minus(times(1 / h, minus(here, _node(points, world, p))), _node(wall_speed, world, p))
            speed = add(speed, _node(tread_speed, world, p))
            slip = minus(speed, times(dot(speed, normal), normal))
            _put(points, world, p, here)
            pressed, one, other = felt[world, column], felt[world, column + 1], felt[world, column + 2]
            out = felt[world, column + 3], felt[world, column + 4], felt[world, column + 5]
            along = felt[world, column + 6], felt[world, column + 7], felt[world, column + 8]
            rubbed = add(times(one, along), times(other, cross(out, along)))
            load[world, p] = pressed
            _put(force, world, p, minus(rubbed, times(pressed, normal)))
            drag = np.hypot(one, other) / max(np.sqrt(dot(slip, slip)), least_slip)
            damping[world, p, 0] = stiffness[world, p] * ahead[world] if pressed > 0 else 0.0
            damping[world, p, 1] = drag if pressed > 0 else 0.0


def _contacts(
    sphere_of: Any,
    geoms: Any,
    frames: Any,
    rows: Any,
    efc_force: Any,
    efc_speed: Any,
    friction: bool,
    damper: Any,
    least_slip: float,
    force: Any,
    damping: Any,
) -> None:
    """Sum up what MuJoCo's contacts of one world do to the wall at each sphere, and how they damp it.

    Args:
        sphere_of: sphere of each geom.
        geoms: of each contact; the second is the sphere's.
        frames: of each contact, normal towards the sphere.
        rows: first row of each contact among the constraints, negative without.
        efc_force: of each row [N].
        efc_speed: of each row [m/s].
        friction: whether contacts have rows of friction.
        damper: of each sphere's contact along its normal, with what a step of its spring adds [N s/m].
        least_slip: friction damps as where it slides at least so fast [m/s].
        force: on the wall, into which it is written [N].
        damping: along the normal and across it [N s/m].
    """
    force[:], damping[:] = 0.0, 0.0
    for c in range(len(rows)):
        row = rows[c]
        if row < 0 or efc_force[row] <= 0:
            continue
        sphere = sphere_of[geoms[c, 1]]
        damping[0, sphere, 0] += damper[sphere]
        for axis in range(3 if friction else 1):
            for i in range(3):
                force[0, sphere, i] -= efc_force[row + axis] * frames[c, 3 * axis + i]
        if friction:
            drag = np.hypot(efc_force[row + 1], efc_force[row + 2])
            slip = np.hypot(efc_speed[row + 1], efc_speed[row + 2])
            damping[0, sphere, 1] += drag / max(slip, least_slip)


def _edge_rate(shape: Any, speed: Any, world: int, edge: int) -> Any:
    rate = minus(_node(speed, world, edge + 1), _node(speed, world, edge))
    return unit_rate(_node(shape.units, world, edge), shape.lengths[world, edge], rate)


def _step_axis(
    own: Any,
    worlds: Any,
    pose: Any,
    speed: Any,
    shape: Any,
    arcs: Any,
    lever: Any,
    force: Any,
    damping: Any,
    h: float,
    time: Any,
    found: Any,
    way: Any,
    drawn: Any,
) -> None:
    """One time step of the axes of these worlds, in place, that begins at those times [s].

    Partners of nodes are found anew where loops may have come nearer, since that was done, by `way`; `drawn` is what
    `_thread` found.
    """
    _shape(own, worlds, pose, shape)
    count = pose.shape[1]
    pulled, couples, torque = np.empty((1, count, 3)), np.empty((count, 3, 3)), np.empty(count)
    gripped, gripped_turn = np.empty(count), np.empty(count)
    flattened, leaning = np.empty(count), np.empty(count)
    diagonal, tie, braked = np.empty(count), np.empty(count), np.zeros(count)
    firm, opens = np.zeros(count), np.zeros(count)
    for world in worlds:
        pulled[:], couples[:], gripped[:], gripped_turn[:] = 0.0, 0.0, 0.0, 0.0
        flattened[:], leaning[:] = 0.0, 0.0
        for p in range(arcs.shape[1]):
            f = _node(force, world, p)
            if arcs[world, p] <= 0 or (f[0] == 0 and f[1] == 0 and f[2] == 0 and damping[world, p, 0] == 0):
                continue
            at, share = node_cell(np, own.spacing[world], count, arcs[world, p])
            held, pressed = _node(lever, world, p), grip_resistance(damping[world, p, 0])
            resists, leans = pressed + damping[world, p, 1], lean_grip(np, f, pressed, damping[world, p, 1])
            for later in range(2):
                node, part = at + later, share if later else 1 - share
                square = part * dot(held, held)
                gripped[node] += part * resists
                gripped_turn[node] += square * resists
                flattened[node] += square * pressed
                leaning[node] += square * leans
                _put_more(pulled, 0, node, times(part, f))
                for i in range(3):
                    for j in range(3):
                        couples[node, i, j] += part * f[i] * held[j]
        _add_springs(own, world, shape, couples, pulled, torque, firm, opens)
        _lean(own, world, shape, flattened, leaning)
        surrounded = own.walls[world, 0] > 0 or own.breaths[world, 1] > 0
        breathed = breath(np, own.breaths[world, 1], time[world]) if surrounded else 0.0
        if own.touch[world] > 0:
            if way[world] >= STALE:
                _look(own, world, pose, found)
                way[world] = 0.0
            _press_loops(own, world, pose, found, pulled, braked)
        for i in range(count):
            at, pressed, stiffness = _node(pose, world, i), (0.0, 0.0, 0.0), 0.0
            if surrounded:
                pressed, stiffness = _enveloped(own, world, i, at, breathed)
                at = add(at, times(breathed * own.sway[world, i], _node(own.body, world, 2)))
            at = add(at, _node(own.root, world, i))
            _put_more(pulled, 0, i, add(pressed, times(gripped[i], _node(speed, world, i))))
            _put_more(pulled, 0, i, _node(drawn, world, i))
            _put_more(pulled, 0, i, hold_force(np, at, own.slack[world, i], own.hold[world, i], own.support[world, i]))
            diagonal[i] = node_resistance(
                np,
                at,
                own.slack[world, i],
                own.hold[world, i],
                own.support[world, i],
                own.drag[world, i],
                gripped[i] + h * (stiffness + braked[i] + drawn[world, i, 3]),
                h,
            )
        for i in range(count - 1):
            before = own.upright[world, i] + bend_stiffness(np, own.bending[world, i], shape.sums[world, i])
            after = own.upright[world, i + 1] + bend_stiffness(np, own.bending[world, i + 1], shape.sums[world, i + 1])
            length, rest = shape.lengths[world, i], own.lengths[world, i]
            tie[i], along = edge_resistance(np, length, rest, own.tension[world, i], before, after, h)
            tie[i] += packed_resistance(np, length, (firm[i], opens[i]), (firm[i + 1], opens[i + 1]), h)
            held = (leaning[i] + leaning[i + 1]) / length**2
            unit, apart = _node(shape.units, world, i), minus(_node(speed, world, i + 1), _node(speed, world, i))
            kept = add(times(held, apart), times(along * dot(unit, apart), unit))
            _put_more(pulled, 0, i, kept)
            _put_more(pulled, 0, i + 1, times(-1.0, kept))
            tie[i] += held
            diagonal[i] += tie[i]
            diagonal[i + 1] += tie[i]
        # Thomas's algorithm; off the diagonal stands -tie.
        for i in range(1, count):
            share = tie[i - 1] / diagonal[i - 1]
            diagonal[i] -= share * tie[i - 1]
            _put_more(pulled, 0, i, times(share, _node(pulled, 0, i - 1)))
        fastest = 0.0
        for i in range(count - 1, -1, -1):
            right = _node(pulled, 0, i)
            if i + 1 < count:
                right = add(right, times(tie[i], _node(speed, world, i + 1)))
            moving = times(1 / diagonal[i], right)
            _put(speed, world, i, moving)
            _put_more(pose, world, i, times(h, moving))
            fastest = max(fastest, dot(moving, moving))
        way[world] += nearer(np.sqrt(fastest), h)
        _turn_sections(own, world, pose, speed, shape, torque, gripped_turn, h)


def _thread(own: Any, worlds: Any, pose: Any, points: Any, arcs: Any, drawn: Any, borne: Any) -> bool:
    """What shafts and nodes do to each other between neighbouring spheres (`haustra.models.wall.threads`).

    A node is drawn to the piece of shaft that ends in the first sphere beyond it, which bears as much.

    Args:
        own: of each world.
        worlds: which.
        pose: of the nodes (worlds, nodes, 7).
        points: middles of the spheres, from the shaft's end to its tip (worlds, spheres, 3) [m].
        arcs: their arc lengths (worlds, spheres) [m].
        drawn: force on each node, and a bound of its slope, into which they are written (worlds, nodes, 4) [N], [N/m].
        borne: force on each sphere, and its moment about it, into which they are written (worlds, spheres, 6).

    Returns:
        Whether there is any.
    """
    some = False
    for world in worlds:
        drawn[world], borne[world] = 0.0, 0.0
        furthest, spacing, nodes = max(arcs[world, 0], 0.0), own.spacing[world], pose.shape[1]
        for p in range(1, points.shape[1]):
            before, here, arc = _node(points, world, p - 1), _node(points, world, p), arcs[world, p]
            for k in range(int(furthest / spacing) + 1, min(int(max(arc, 0.0) / spacing) + 1, nodes)):
                radius = lumen_radius(np, own.drag[world, k], own.turn_drag[world, k])
                node = add(_node(own.nodes, world, k), _node(pose, world, k))
                out, force, place = ring_force(np, node, before, here, radius)
                if out > 0:
                    some = True
                    _put(drawn, world, k, force)
                    drawn[world, k, 3] = RING
                    moment = cross(minus(place, here), force)
                    for i in range(3):
                        borne[world, p, i] -= force[i]
                        borne[world, p, 3 + i] -= moment[i]
            furthest = max(furthest, arc)
    return some


def _look(own: Any, world: int, pose: Any, found: Any) -> None:
    """Find the partners of all nodes of a world (`haustra.models.wall.loops.partners`)."""
    count = pose.shape[1]
    places = np.empty((1, count, 3))
    for i in range(count):
        _put(places, 0, i, add(_node(own.nodes, world, i), _node(pose, world, i)))
    for i in range(count):
        here, best, most = _node(places, 0, i), np.inf, 0.0
        for j in range(1, count, 2):
            kept = own.girth[world, i] + own.girth[world, j]
            if apart(i - j, own.spacing[world], kept):
                near = nearness(_node(places, 0, j), here, kept)
                if near < best:
                    best, most, found[world, i] = near, kept, j
        if best >= MARGIN * (2 * most + MARGIN):
            found[world, i] = -1


def _press_loops(own: Any, world: int, pose: Any, found: Any, pulled: Any, braked: Any) -> None:
    """Add what loops do to each other to the forces on nodes; write what bounds its slope."""
    last = pose.shape[1] - 1
    braked[:] = 0.0
    for i in range(last + 1):
        at = found[world, i]
        if at < 0:
            continue
        three = max(at - 1, 0), at, min(at + 1, last)
        here = add(_node(own.nodes, world, i), _node(pose, world, i))
        before = add(_node(own.nodes, world, three[0]), _node(pose, world, three[0]))
        middle = add(_node(own.nodes, world, three[1]), _node(pose, world, three[1]))
        after = add(_node(own.nodes, world, three[2]), _node(pose, world, three[2]))
        shares, distance, way = contact(np, here, before, middle, after)
        kept = own.girth[world, i] + own.girth[world, at]
        force, slope = touch_force(np, distance, kept, own.touch[world] / 2)
        _put_more(pulled, 0, i, times(force, way))
        braked[i] += 2 * slope
        for part in range(3):
            _put_more(pulled, 0, three[part], times(-shares[part] * force, way))
            braked[three[part]] += 2 * shares[part] * slope


def _enveloped(own: Any, world: int, node: int, place: Any, drawn: float) -> Any:
    """Force of the envelope on a node, and a bound of its slope, with so much of a breath in."""
    body = _node(own.body, world, 0), _node(own.body, world, 1), _node(own.body, world, 2)
    walls = own.walls[world, 0], own.walls[world, 1]
    return envelope_force(np, place, body, own.room[world, node], walls, drawn * own.breaths[world, 0])


def _lean(own: Any, world: int, shape: Any, flattened: Any, leaning: Any) -> None:
    """From what contacts resist at nodes to what changes of the edges' directions meet: sections lean and flatten."""
    last = shape.lengths.shape[1]
    reach = np.zeros(last)
    for i in range(last + 1):
        if flattened[i] > 0:
            cells = _cells(shape.closings, world, i)
            closing = node_closing(cells[0], cells[1], _node(shape.tangents, world, i))
            turn = _turn(shape.turns, world, i, 0)
            rest = turned(turn[0], turn[1], _node(own.closings, world, i))
            each = flattened[i] * flattening_reach(np, closing, rest, own.widths[world, i]) ** 2
            reach[max(i - 1, 0)] += each
            reach[min(i, last - 1)] += each
    for i in range(last):
        now = _node(shape.tangents, world, i), _node(shape.tangents, world, i + 1)
        both = 2 * reach[i] * cell_closing_reach(np, now[0], now[1], shape.lengths[world, i]) ** 2
        leaning[i] += both
        leaning[i + 1] += both
    for i in range(last + 1):
        leaning[i] = lean_resistance(leaning[i], shape.sums[world, i])


def _turn_sections(
    own: Any, world: int, pose: Any, speed: Any, shape: Any, torque: Any, gripped: Any, h: float
) -> None:
    """Turn the sections of a world about the axis for a time step."""
    count = pose.shape[1]
    diagonal = np.empty(count)
    for i in range(count):
        diagonal[i] = node_turn_resistance(own.upright[world, i], own.turn_drag[world, i], gripped[i], h)
        torque[i] += gripped[i] * speed[world, i, 3]
    for i in range(count - 1):
        diagonal[i] += h * own.torsion[world, i]
        diagonal[i + 1] += h * own.torsion[world, i]
    for i in range(1, count):
        share = h * own.torsion[world, i - 1] / diagonal[i - 1]
        diagonal[i] -= share * h * own.torsion[world, i - 1]
        torque[i] += share * torque[i - 1]
    for i in range(count - 1, -1, -1):
        right = torque[i]
        if i + 1 < count:
            right += h * own.torsion[world, i] * speed[world, i + 1, 3]
        speed[world, i, 3] = right / diagonal[i]
        turn = twisted(_turn(shape.turns, world, i, 0), _node(shape.tangents, world, i), h * speed[world, i, 3])
        _put_turn(pose, world, i, 3, turn)


def _add_springs(
    own: Any, world: int, shape: Any, couples: Any, pulled: Any, torque: Any, firm: Any, opens: Any
) -> None:
    """Add the forces along and across the axis to those on its nodes; write the torques about it.

    And how much folds that press on each other resist, between the ends (`PackedBend.stiffness`, `PackedBend.along`).
    """
    last = shape.lengths.shape[1]
    still = 1.0, (0.0, 0.0, 0.0)
    shortening, opening = np.empty(last), np.zeros(last)
    work, over_cells, over_units = np.zeros((1, last + 1, 3)), np.zeros((1, last, 3)), np.zeros((1, last, 3))
    for i in range(last + 1):
        rows = _node(couples, i, 0), _node(couples, i, 1), _node(couples, i, 2)
        section, tangent = _section(shape, world, i), _node(shape.tangents, world, i)
        cells = _cells(shape.closings, world, i)
        leaning, twisting, first, later = section_gradient(
            np, section, tangent, cells, _node(own.closings, world, i), own.widths[world, i], rows
        )
        _put_more(over_cells, 0, max(i - 1, 0), first)
        _put_more(over_cells, 0, min(i, last - 1), later)
        rest = _node(own.tangents, world, i)
        turn = section[0], section[1]
        tilt, lean = twist(np, still, turn, (rest, tangent), still)
        righting = own.upright[world, i] * tilt
        torque[i] = twisting - righting
        _put_more(work, 0, i, minus(leaning, times(righting, lean)))
    for i in range(last):
        now = _node(shape.tangents, world, i), _node(shape.tangents, world, i + 1)
        turns = _turn(shape.turns, world, i, 0), _turn(shape.turns, world, i + 1, 0)
        wound, binormal = twist(np, turns[0], turns[1], now, _turn(own.ways, world, i, 0))
        moment = own.torsion[world, i] * wound
        torque[i] += moment
        torque[i + 1] -= moment
        length, over = shape.lengths[world, i], _node(over_cells, 0, i)
        first, later, shortening[i] = cell_closing_gradient(np, now[0], now[1], length, over)
        _put_more(work, 0, i, minus(first, times(moment, binormal)))
        _put_more(work, 0, i + 1, minus(later, times(moment, binormal)))
    for i in range(last + 1):
        over = unit_rate(_node(shape.tangents, world, i), shape.sums[world, i], _node(work, 0, i))
        if 0 < i < last:
            bent, packed = _bends(own, world, shape, i)
            firm[i], opens[i] = packed.stiffness, packed.along
            opening[i - 1] += bent.tension + packed.tension
            opening[i] += bent.tension + packed.tension
            bend = add(bent.gradient, packed.gradient)
            _put_more(over_units, 0, i, minus(over, bend))
            _put_more(over_units, 0, i - 1, add(over, bend))
        else:
            _put_more(over_units, 0, min(i, last - 1), over)
        _put_more(pulled, 0, i, _node(own.load, world, i))
    for i in range(last):
        unit, length = _node(shape.units, world, i), shape.lengths[world, i]
        tension = edge_tension(np, length, own.lengths[world, i], own.tension[world, i], own.pleating[world])
        tension += gas_thrust(
            np, own.pressure_lost[world], own.drag[world, i], own.turn_drag[world, i], own.tension[world, i]
        )
        pull = minus(
            times(tension - shortening[i] + opening[i], unit), unit_rate(unit, length, _node(over_units, 0, i))
        )
        _put_more(pulled, 0, i, pull)
        _put_more(pulled, 0, i + 1, times(-1.0, pull))


def _bends(own: Any, world: int, shape: Any, node: int) -> Any:
    """`wall_bend` and `packed_bend` at a node between others."""
    change = minus(_node(shape.units, world, node), _node(shape.units, world, node - 1))
    length = shape.lengths[world, node - 1] + shape.lengths[world, node]
    rest = own.lengths[world, node - 1] + own.lengths[world, node]
    turn, bending = own.turns[world, node], own.bending[world, node]
    packed = packed_bend(np, length, rest, change, turn, bending, own.widths[world, node])
    return wall_bend(np, length, rest, change, turn, bending), packed


def _named(name: str, entry: Callable[..., Any]) -> Callable[..., Any]:
    """Numba keeps one index a name: processes that write the same one lose each other's entries."""
    entry.__name__ = entry.__qualname__ = name
    return entry


@cache
def loops() -> Loops:
    """Compile, or read what was compiled before."""
    from numba import njit
    from numba.extending import overload

    overload(vectors.where)(lambda xp, condition, yes, no: lambda xp, condition, yes, no: yes if condition else no)
    own = (_node, _put, _put_more, _turn, _put_turn, _section, _cells, _rest_closing, _node_between, _edge_rate)
    own = (*own, _rates, _add_springs, _lean, _turn_sections, _spread, _enveloped, _press_loops, _look)
    own = (*own, _follow, _bends)
    entries = (
        _query,
        _query_moved,
        _place_planes,
        _pressed,
        _contacts,
        _step_axis,
        _thread,
        _shape,
        _carry,
        _way,
        _along,
        _indent,
        _lift,
    )
    entries = (*entries, _stands_between, _unfold, contact_solver.solve)
    laws = (*vectors.PARTS, *law.PARTS, *lumen_table.PARTS, *sections.PARTS, *surroundings.PARTS, *loops_law.PARTS)
    laws = (*laws, *moving_colon.PARTS)
    laws = (*laws, *plane_pose.PARTS, *indentation.PARTS, *unfolding.PARTS, *threads.PARTS)
    laws = (*laws, *own, *entries[:-1])
    # Products may be added at once; sums keep their order, or code from the cache would round as no other does.
    options = {"error_model": "numpy", "fastmath": {"contract"}}
    solver = (*contact_solver.PARTS, contact_solver.solve)
    each: Any = *((part, {}) for part in laws), *((part, options) for part in solver)
    for part, how in each:
        plain = unwrap(part)  # of what checks types at run time
        overload(part, strict=False, jit_options=how)(lambda *_, plain=plain: plain)
    modules = vectors, law, lumen_table, sections, surroundings, loops_law, moving_colon, plane_pose, planes
    modules = (*modules, contact_solver, indentation, unfolding, threads)
    files = [Path(str(module.__file__)) for module in modules]
    version = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()

    def compiled(loop: Callable[..., Any]) -> Callable[..., Any]:
        # Numba finds again what it has kept by the values that a function closes over.
        entry = _named(loop.__name__, lambda *given: loop(*given) if version else None)
        return njit(entry, nogil=True, cache=True, error_model="numpy")

    return Loops(*map(compiled, entries))
