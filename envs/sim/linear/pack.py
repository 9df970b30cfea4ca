"""From a scene, colons and parameters to the arrays that programs work on."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.linear.layout import AROUND, AXIS, BODY, DOF, SCOPE, STATION, STRUCTURE, Layout
from haustra.envs.sim.scope_reading import ScopeChain
from haustra.envs.sim.scope_values import Scope
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.wall.lumen_table import Tables, least_radius
from haustra.models.wall.mesentery import Mesentery

_STRAIGHT = 1e-9
"""What lies further from a link's axis than this [m, or of directions 1] is not on it."""


@dataclass(frozen=True)
class Structure:
    """How a scope hangs together."""

    layout: Layout
    numbers: Int[np.ndarray, " structure"]
    """As `layout.STRUCTURE` says."""
    coils: Int[np.ndarray, " coils"]
    """Which of the places that are read off each of the imager's coils has."""


def structure_of(own: ScopeChain) -> Structure:
    """How a scope hangs together, as programs read it.

    Raises:
        UnsupportedSceneError: when it is not a slide and a hinge, then hinges, all through the links' axes.
    """
    chain, bodies, spheres = own.chain, len(own.chain.last_dof), len(own.sample_body)
    straight = np.abs(chain.turn - np.eye(3)).max() < _STRAIGHT
    in_order = (np.diff(own.sample_body) >= 0).all()
    if chain.hinge[0] or not chain.hinge[1:].all() or chain.body_of_dof[1] != 0 or not (straight and in_order):
        raise UnsupportedSceneError(
            "The backend 'linear' takes one chain of hinges that a hand pushes and turns: use 'native' for this device."
        )
    first = np.append(0, chain.last_dof[:-1] + 1)
    ends = np.searchsorted(own.sample_body, np.arange(bodies + 1))
    of_tip = np.arange(bodies) >= bodies - len(own.bend_dofs[0])
    table = np.stack([first, chain.last_dof + 1, ends[:-1], ends[1:], of_tip], axis=1)
    assert table.shape[1] == STRUCTURE
    coils = np.full(spheres, -1)
    on, places = np.unique(own.coils, return_inverse=True)  # near spheres carry several
    coils[on] = np.arange(len(on))
    numbers = np.concatenate([table.ravel(), own.scale, coils]).astype(np.int32)
    return Structure(Layout(len(chain.axis), bodies, spheres), numbers, places)


def pack_design(scope: Scope, own: ScopeChain, layout: Layout) -> Float[np.ndarray, "designs slots"]:
    """Numbers of scopes in the order of `Layout.design`.

    Raises:
        UnsupportedSceneError: when a link's origin, mass or spheres are not on its axis.
    """
    links, count, chain = scope.links, len(scope.start), own.chain
    inertia = links.inertia
    off = [links.offset[:, 1:, :2], links.centre[..., :2], scope.sample_place[..., :2], scope.tip_place[..., :2]]
    unequal = [inertia[..., 0, 0] - inertia[..., 1, 1], inertia[..., [0, 0, 1], [1, 2, 2]]]
    if any(np.abs(part).max() > _STRAIGHT for part in off) or any(np.abs(part).max() > 1e-12 for part in unequal):
        raise UnsupportedSceneError("The backend 'linear' takes links of revolution only: use 'native' instead.")
    each = np.zeros((count, len(chain.axis), len(DOF)))
    each[:, :, :3] = chain.axis
    names = {"stiffness": scope.stiffness, "damping": scope.damping, "armature": scope.armature, "rest": scope.rest,
             "low": scope.low, "high": scope.high}  # fmt: skip
    names |= {name: scope.arms[:, wire] for wire, name in enumerate(WIRE_NAMES)}
    for name, values in names.items():
        each[:, :, DOF.index(name)] = values
    locked = own.lock_dofs.ravel()
    each[:, locked, DOF.index("behind")] = np.repeat(scope.behind, 2, axis=1)
    each[:, locked, DOF.index("lock_stiffness")] = scope.lock_stiffness
    each[:, locked, DOF.index("lock_damping")] = scope.lock_damping
    each[:, locked, DOF.index("ring")] = np.repeat(scope.ring, 2, axis=1)
    each[:, :, DOF.index("cubic")] = scope.cubic
    body = np.stack(
        [links.offset[..., 2], links.mass, links.centre[..., 2], inertia[..., 0, 0], inertia[..., 2, 2]], -1
    )
    assert body.shape[-1] == len(BODY)
    first = scope.radius, scope.start, scope.tip_place[:, 0, 2], scope.pull_limit, scope.wire_friction
    last = scope.wire_radius, scope.wire_slack, scope.wire_compliance
    middle = scope.wire_hysteresis, scope.length, scope.pull_per_angle, scope.bend_limit
    whole = np.stack([*first, *middle, *last], axis=-1)
    assert whole.shape[-1] == len(SCOPE)
    each, body = (_side_by_side(part, layout.abreast) for part in (each, body))
    flat = (part.reshape(count, -1) for part in (each, body, scope.sample_place[..., 2], whole))
    return np.concatenate(list(flat), axis=1)


def _side_by_side(numbers: np.ndarray, abreast: int) -> np.ndarray:
    """Numbers (designs, things, kinds) of so many things at a time, kind by kind (`memory.Numbers`)."""
    count, things, kinds = numbers.shape
    padded = np.pad(numbers, ((0, 0), (0, -things % abreast), (0, 0)))
    return np.swapaxes(padded.reshape(count, -1, abreast, kinds), 2, 3)


def pack_tables(tables: Tables, width: Any = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rows of stations and of the wall, of colons stacked one after the other; `width` of the lumen at each [m]."""
    rows = np.zeros((len(tables.points), 4, 4))
    rows[:, 0, :3], rows[:, 0, 3] = tables.points, least_radius(tables.wall)
    rows[:, 1:, :3], rows[:, 1, 3] = np.swapaxes(tables.frames, 1, 2), width
    return rows.reshape(-1, STATION), np.asarray(tables.wall)


def pack_axis(own: Mesentery, columns: tuple[str, ...]) -> Float[np.ndarray, "nodes columns"]:
    """Rows of the nodes of stacked colons that move, one colon after the other.

    Args:
        own: the colons' axes.
        columns: of the program (`Layout.columns`).

    Raises:
        InvalidOptionError: when a mesentery holds NaN, which laws that take the larger of two numbers would pass over;
            when it has neighbours that the program leaves out.
    """
    added = {"room": own.surrounded, "root": own.rooted, "girth": own.touching}
    if any(there and name not in columns for name, there in added.items()):
        raise InvalidOptionError(
            "An envelope, breath, roots or loops that touch cannot be added to colons: begin with them."
        )
    if any(np.isnan(part).any() for part in own):
        raise InvalidOptionError("A colon's mesentery holds what is no number: give it numbers.")
    colons, nodes = own.turns.shape
    rows = np.zeros((colons, nodes, len(columns)))
    rows[..., 0:3], rows[..., 4:7] = own.nodes, own.tangents
    for name, values in (("closing", own.closings), ("load", own.load)):
        first = AXIS.index(name)
        rows[..., first : first + 3] = values
    for name, values in (("length", own.lengths), ("tension", own.tension), ("torsion", own.torsion)):
        rows[:, :-1, AXIS.index(name)] = values
    for name in ("bending", "slack", "hold", "support", "drag", "upright", "turn_drag"):
        rows[..., AXIS.index(name)] = getattr(own, name)
    rows[..., AXIS.index("width")] = own.widths
    rows[:, :-1, AXIS.index("way") :][..., :4] = own.ways
    rows[..., AXIS.index("turn")] = own.turns
    if "room" in columns:
        alike = np.concatenate([own.walls, own.breaths, own.body.reshape(colons, 9)], axis=1)
        alike = np.broadcast_to(alike[:, None], (colons, nodes, alike.shape[1]))
        around = np.concatenate([own.room, own.sway[..., None], alike], axis=2)
        rows[..., columns.index("room") :][..., : len(AROUND)] = around
    if "root" in columns:
        rows[..., columns.index("root") :][..., :3] = own.root
    if "girth" in columns:
        rows[..., columns.index("girth")] = own.girth
        rows[..., columns.index("touch")], rows[..., columns.index("between")] = (
            own.touch[:, None],
            own.spacing[:, None],
        )
    return np.vstack([rows.reshape(-1, len(columns)), np.ones((1, len(columns)))])  # one more: read behind the last
