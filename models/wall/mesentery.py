"""A colon that is not fixed in space: its axis hung on the mesentery, free to swing, to stretch and to pleat.

The axis is a row of nodes. Between neighbours the wall's tube resists stretching and, less, pleating; bending is that
of a tube that is free to turn about itself. Nodes of sigmoid and transverse colon hang on a mesentery that is slack up
to its height and then taut; rectum, descending and ascending colon and caecum have grown to the back wall, and the
anus is held. Cross-sections go along with the axis (`haustra.models.wall.sections`).
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.wall import sections, vectors
from haustra.models.wall.abdomen import DOWN, FALL, Abdomen, turned_weight
from haustra.models.wall.loops import girths
from haustra.models.wall.surroundings import UNBOUND, rooms, swayed, under_hand
from haustra.quantity import load_quantities

NODE_SPACING = 0.01
"""Distance between nodes [m], about: half the radius of a sigmoid's lumen; engineering choice."""
INDENTED = 0.005
"""Sections flatten as if the lumen were wider by this [m]: a device stands in its wall; engineering choice."""
_CLOSED = 0.9
"""Furthest that the wall on the inside of a bend stands at rest, over the way to the bend's middle [1]: what is seen
beyond from the axis is the wall of another stretch; engineering choice."""
_RISE = 1.5
"""The mesentery reaches its full height over the middle of a segment, from sin(pi share) times this: it is shortest
where it ends; engineering choice."""
_APART = 1.0
"""Distance between nodes that only fill up the arrays of a short colon [m]."""


class Mesentery(NamedTuple):
    """One colon's axis, or several: then the colons come first, and short ones are filled up with nodes that hold."""

    nodes: Any
    """(nodes, 3) places at rest [m]."""
    tangents: Any
    """(nodes, 3) directions at rest."""
    ways: Any
    """(nodes - 1, 4) turns that bring the direction at each node to that at the next, as unit quaternions."""
    closings: Any
    """(nodes, 3) how far the bend closes at each node at rest [1/m] (`sections.node_closing`)."""
    widths: Any
    """(nodes,) from the axis to where no wall is further [m]."""
    turns: Any
    """(nodes,) how far the direction changes from the edge before each node to the one after, at rest [1]: twice the
    tangent of half the angle; 0 at the ends."""
    lengths: Any
    """(nodes - 1,) distances between neighbours at rest [m]."""
    tension: Any
    """(nodes - 1,) EA of the tube when stretched [N]."""
    bending: Any
    """(nodes,) EI of the tube over the spacing [N m]; 0 at the ends."""
    torsion: Any
    """(nodes - 1,) GJ of the tube over the spacing [N m]."""
    slack: Any
    """(nodes,) how far a node may be from what it hangs on before its mesentery is taut [m]."""
    hold: Any
    """(nodes,) stiffness of the taut mesentery, or of what a fixed segment has grown to [N/m]."""
    support: Any
    """(nodes,) stiffness of what lies around [N/m]."""
    root: Any
    """(nodes, 3) from what a node hangs on to where it is at rest [m]; 0 where that is where it was imaged."""
    drag: Any
    """(nodes,) damping [N s/m]."""
    upright: Any
    """(nodes,) how stiffly what the wall has grown to, and what lies around, keep a section from turning about the axis
    [N m]."""
    turn_drag: Any
    """(nodes,) damping of that turning [N m s]."""
    load: Any
    """(nodes, 3) constant forces: weight [N]."""
    room: Any
    """(nodes, 6) how far a node moves before the envelope presses on it, to each of `surroundings.SIDES` [m]; negative
    under a hand that presses the belly in."""
    sway: Any
    """(nodes,) how far a whole breath moves what a node hangs on towards the feet [m]."""
    body: Any
    """(3, 3) the patient's directions: to the left, to the back and to the head."""
    down: Any
    """(3,) direction of gravity, as the patient lies."""
    walls: Any
    """(2,) stiffness of the envelope at the front and elsewhere, for a node [N/m]; 0 without an envelope, but for the
    front where a hand presses."""
    breaths: Any
    """(2,) how far breath moves the envelope's wall at the head [m], and breaths a second [1/s]; 0 without breath."""
    girth: Any
    """(nodes,) from the axis to where other loops touch the colon [m]."""
    touch: Any
    """Stiffness of loops against each other, for a node [N/m]: one number, or one a colon; 0 if they do not touch."""
    pleating: Any
    """Stiffness in compression over that in tension [1]: one number, or one a colon."""
    pressure_lost: Any
    """Pressure of gas that has been lost since the colon was imaged (`moving_colon.gas_thrust`) [Pa]: one number, or
    one a colon."""
    spacing: Any
    """Arc length between nodes [m]: one number, or one a colon."""

    @property
    def surrounded(self) -> bool:
        """Whether there is an envelope, a hand on the belly or breath (`haustra.models.wall.surroundings`)."""
        return bool(np.any(self.walls) or np.any(self.breaths))

    @property
    def rooted(self) -> bool:
        """Whether mesenteries hang from their roots (`Abdomen.rooted`)."""
        return bool(np.any(self.root))

    @property
    def touching(self) -> bool:
        """Whether loops touch each other (`haustra.models.wall.loops`)."""
        return bool(np.any(self.touch))


def hang(
    points: Float[np.ndarray, "stations 3"],
    arcs: Float[np.ndarray, " stations"],
    radius: Float[np.ndarray, " stations"],
    segments: Sequence[ColonSegment],
    *,
    widest: Float[np.ndarray, " stations"] | None = None,
    abdomen: Abdomen | None = None,
    changed: Mapping[str, float] | None = None,
) -> Mesentery:
    """Hang a colon on its mesentery, by the numbers of assets/numbers/mesentery.toml.

    Args:
        points: the centreline [m].
        arcs: its arc lengths [m].
        radius: mean radius of the lumen there [m].
        segments: what is mobile, and what is fixed; without any, all of it is fixed.
        widest: largest radius of the lumen there [m]; `radius` when None.
        abdomen: what it lies in; as it was imaged when None.
        changed: numbers to take instead of those of the file, by their names there.
    """
    numbers = {name: each.value for name, each in load_quantities(asset("numbers/mesentery.toml")).items()}
    numbers |= changed or {}
    own, nodes, tangents = axis_nodes(points, arcs)
    count, spacing, edges = len(own), float(own[1]), np.diff(nodes, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    edges = edges / lengths[:, None]
    turns = np.zeros(count)
    apart, alike = (np.linalg.norm(sign * edges[1:] + edges[:-1], axis=1) for sign in (-1, 1))
    turns[1:-1] = 2 * apart / alike
    around = abdomen or Abdomen()
    root = np.zeros((count, 3))
    slack, thickness = np.zeros(count), np.full(count, numbers["mesentery.thickness.other"])
    hand, freed = np.zeros(count, dtype=bool), {"sigmoid", "transverse", *around.mobile}
    hold = np.full(count, numbers["mesentery.attachment"])
    for segment in segments:
        inside = (own >= segment.start) & (own < segment.end)
        share = (own[inside] - segment.start) / (segment.end - segment.start)
        height = numbers.get(f"mesentery.height.{segment.name}", 0.0)
        if height and segment.name in freed:
            slack[inside] = height * np.minimum(1.0, _RISE * np.sin(np.pi * share))
            hold[inside] = numbers["mesentery.stiffness"]
            if around.rooted:
                root[inside] = _from_root(nodes[inside])
                slack[inside] += np.linalg.norm(root[inside], axis=1)
        middle = np.abs(own - (segment.start + segment.end) / 2) <= numbers["mesentery.grip"] / 2
        if segment.name in around.adhesions:
            root[middle], slack[middle], hold[middle] = 0.0, 0.0, numbers["mesentery.attachment"]
        if segment.name == around.pressed:
            hand |= middle
        thickness[inside] = numbers.get(f"mesentery.thickness.{segment.name}", thickness[0])
    tube_radius = np.interp(own, arcs, radius)
    stretch = numbers["mesentery.modulus"] * 2 * np.pi * tube_radius * thickness
    bending = numbers["mesentery.bending"] * stretch * tube_radius**2 / 2 / spacing
    bending[[0, -1]] = 0.0
    weight = numbers["mesentery.density"] * 2 * np.pi * tube_radius * thickness * spacing * FALL
    each = np.full(count, spacing)
    hold, support, drag = hold * each, numbers["mesentery.support"] * each, numbers["mesentery.drag"] * each
    upright = (np.where(slack > 0, 0.0, hold) + support) * tube_radius**2
    torsion = around.torsion * numbers["mesentery.torsion"] * 2 / 3 * stretch * tube_radius**2 / 2 / spacing
    hold[0] += numbers["mesentery.anus"]
    closings = _closings(tangents, lengths)
    walls = np.array([numbers[f"mesentery.envelope.{side}"] for side in ("front", "firm")]) * spacing
    outer = tube_radius + thickness
    room = rooms(nodes, outer, numbers["mesentery.envelope.margin"])
    if hand.any():
        room = under_hand(room, hand, around.hand, walls[0], envelope=around.envelope)
    breaths = np.array([numbers["mesentery.breath.excursion"], numbers["mesentery.breath.rate"]])
    return Mesentery(
        nodes=nodes,
        tangents=tangents,
        ways=_ways(tangents),
        closings=closings,
        widths=_widths(closings, _widest_beside(own, arcs, radius if widest is None else widest)),
        turns=turns,
        lengths=lengths,
        tension=(stretch[1:] + stretch[:-1]) / 2,
        bending=bending,
        torsion=(torsion[1:] + torsion[:-1]) / 2,
        slack=slack,
        hold=hold,
        support=support,
        root=root,
        drag=drag,
        upright=upright,
        turn_drag=drag * tube_radius**2,
        load=turned_weight(around.posture, weight) + support[:, None] * root,  # support is from where it is at rest
        room=room,
        sway=swayed(nodes, breaths[0]) * around.breathing,
        body=np.eye(3),
        down=np.array(DOWN[around.posture]),
        walls=walls * np.array([around.envelope or bool(hand.any()), around.envelope]),
        breaths=breaths * around.breathing,
        girth=girths(nodes, outer, spacing) if around.loops_touch else outer,
        touch=np.float64(numbers["mesentery.touch"] * spacing * around.loops_touch),
        pleating=np.float64(numbers["mesentery.pleating"]),
        pressure_lost=np.float64(0.0),
        spacing=np.float64(spacing),
    )


def _from_root(nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
    """From the root of a segment's mesentery to its nodes [m]: the root runs straight between the segment's ends."""
    share = np.linspace(0.0, 1.0, len(nodes))[:, None]
    return nodes - (nodes[:1] + share * (nodes[-1:] - nodes[:1]))


def axis_nodes(
    points: Float[np.ndarray, "stations 3"], arcs: Float[np.ndarray, " stations"]
) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, "nodes 3"], Float[np.ndarray, "nodes 3"]]:
    """Arc lengths of the axis' nodes [m], their places at rest [m] and the directions there.

    Args:
        points: the centreline [m].
        arcs: its arc lengths [m].
    """
    count = max(round(float(arcs[-1]) / NODE_SPACING), 3) + 1
    own = np.linspace(0.0, float(arcs[-1]), count)
    nodes = np.column_stack([np.interp(own, arcs, points[:, axis]) for axis in range(3)])
    edges = np.diff(nodes, axis=0)
    edges = edges / np.linalg.norm(edges, axis=1)[:, None]
    middle = edges[1:] + edges[:-1]
    return own, nodes, np.vstack([edges[:1], middle / np.linalg.norm(middle, axis=1)[:, None], edges[-1:]])


def _ways(tangents: np.ndarray) -> np.ndarray:
    real, part = sections.shortest_turn(np, vectors.of(tangents[:-1]), vectors.of(tangents[1:]))
    return np.stack([real, *part], axis=-1)


def _closings(tangents: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    cells = sections.cell_closing(np, vectors.of(tangents[:-1]), vectors.of(tangents[1:]), lengths)
    each = vectors.stacked(np, cells)
    before, after = np.concatenate([each[:1], each]), np.concatenate([each, each[-1:]])
    return vectors.stacked(np, sections.node_closing(vectors.of(before), vectors.of(after), vectors.of(tangents)))


def _widest_beside(own: np.ndarray, arcs: np.ndarray, widest: np.ndarray) -> np.ndarray:
    """Largest radius of the lumen from the node before each to the one after, and what the wall gives way [m]."""
    near = np.abs(arcs[None] - own[:, None]) <= 1.01 * own[1]
    return np.where(near, widest[None], 0.0).max(axis=1) + INDENTED


def _widths(closings: np.ndarray, widest: np.ndarray) -> np.ndarray:
    """Widths of the wall [m], which ends before the middle of a bend at rest, however far rays from the axis see."""
    return np.minimum(widest, _CLOSED / np.maximum(np.linalg.norm(closings, axis=1), 1e-9))


def seen_from(own: Mesentery, origin: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]) -> Mesentery:
    """In coordinates that begin at `origin` [m], with the columns of `axes` as axes."""
    return own._replace(
        nodes=(own.nodes - origin) @ axes,
        tangents=own.tangents @ axes,
        ways=np.hstack([own.ways[:, :1], own.ways[:, 1:] @ axes]),
        closings=own.closings @ axes,
        load=own.load @ axes,
        root=own.root @ axes,
        body=own.body @ axes,
        down=own.down @ axes,
    )


def may_be_pressed(own: Mesentery) -> Mesentery:
    """With a belly that presses on nothing yet: programs that begin without one take no hand later."""
    if np.any(own.walls):
        return own
    return own._replace(walls=np.add(own.walls, (1.0, 0.0)), room=np.full_like(own.room, UNBOUND))


def stack(colons: Sequence[Mesentery]) -> Mesentery:
    """Several colons, filled up to the same number of nodes."""
    most = max(len(own.nodes) for own in colons)
    filled = [_filled(own, most - len(own.nodes)) for own in colons]
    return Mesentery(*(np.stack(parts) for parts in zip(*filled, strict=True)))


def _filled(own: Mesentery, more: int) -> Mesentery:
    """With nodes behind the last one that bear no load and stay where they are."""
    if not more:
        return own
    ahead = own.tangents[-1] * _APART * np.arange(1, more + 1)[:, None]

    def grown(values: np.ndarray, fill: float) -> np.ndarray:
        return np.concatenate([values, np.full((more, *values.shape[1:]), fill)])

    return own._replace(
        nodes=np.vstack([own.nodes, own.nodes[-1] + ahead]),
        tangents=np.vstack([own.tangents, np.tile(own.tangents[-1], (more, 1))]),
        ways=np.vstack([own.ways, np.tile([1.0, 0.0, 0.0, 0.0], (more, 1))]),
        closings=grown(own.closings, 0.0),
        widths=grown(own.widths, float(own.widths[-1])),
        turns=grown(own.turns, 0.0),
        lengths=grown(own.lengths, _APART),
        tension=grown(own.tension, 0.0),
        bending=grown(own.bending, 0.0),
        torsion=grown(own.torsion, 0.0),
        slack=grown(own.slack, 0.0),
        hold=grown(own.hold, float(own.hold[-1])),
        support=grown(own.support, float(own.support[0])),
        root=grown(own.root, 0.0),
        drag=grown(own.drag, float(own.drag[0])),
        upright=grown(own.upright, float(own.upright[-1])),
        turn_drag=grown(own.turn_drag, float(own.turn_drag[0])),
        load=grown(own.load, 0.0),
        room=grown(own.room, UNBOUND),
        sway=grown(own.sway, 0.0),
        girth=grown(own.girth, 0.0),
    )
