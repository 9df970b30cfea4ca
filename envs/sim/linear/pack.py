"""From a scene, colons and parameters to the arrays that programs work on."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.linear.layout import BODY, DOF, SCOPE, STATION, Layout
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.wall.lumen_table import Tables

_STRAIGHT = 1e-9
"""What lies further from a link's axis than this [m, or of directions 1] is not on it."""


@dataclass(frozen=True)
class Structure:
    """How a scope hangs together."""

    layout: Layout
    numbers: Int[np.ndarray, " structure"]
    """First and last joint and sphere of each link, and then what scales each joint (`layout.WORLD`)."""


def structure_of(chain: Any, scale: Int[np.ndarray, " dofs"], sample_body: Int[np.ndarray, " spheres"]) -> Structure:
    """Read how a chain hangs together.

    Args:
        chain: `haustra.envs.sim.chain.Chain`.
        scale: which of one, bending, tip_bending and torsion scales each joint.
        sample_body: link of each sphere.

    Raises:
        UnsupportedSceneError: when it is not a slide and a hinge, then hinges, all through the links' axes.
    """
    bodies = len(chain.last_dof)
    straight = np.abs(chain.turn - np.eye(3)).max() < _STRAIGHT
    if chain.hinge[0] or not chain.hinge[1:].all() or chain.body_of_dof[1] != 0 or not straight:
        raise UnsupportedSceneError(
            "The backend 'linear' takes one chain of hinges that a hand pushes and turns: use 'native' for this device."
        )
    if (np.diff(sample_body) < 0).any():
        raise UnsupportedSceneError("The backend 'linear' takes spheres in the order of their links: use 'native'.")
    first = np.append(0, chain.last_dof[:-1] + 1)
    spheres = np.searchsorted(sample_body, np.arange(bodies + 1))
    table = np.stack([first, chain.last_dof + 1, spheres[:-1], spheres[1:]], axis=1)
    numbers = np.concatenate([table.ravel(), scale]).astype(np.int32)
    return Structure(Layout(len(chain.axis), bodies, len(sample_body)), numbers)


def pack_design(scope: Any, chain: Any, lock_dofs: Int[np.ndarray, "joints 2"]) -> Float[np.ndarray, "designs slots"]:
    """Numbers of scopes (`haustra.envs.sim.scope_values.Scope`) in the order of `layout.design_slots`.

    Raises:
        UnsupportedSceneError: when a link's origin, mass or spheres are not on its axis.
    """
    scope = type(scope)(type(scope.links)(*(np.asarray(p, float) for p in scope.links)),
                        *(np.asarray(part, float) for part in scope[1:]))  # fmt: skip
    links, count, dofs = scope.links, len(scope.start), len(chain.axis)
    inertia = links.inertia
    off = [links.offset[:, 1:, :2], links.centre[..., :2], scope.sample_place[..., :2], scope.tip_place[..., :2]]
    unequal = [inertia[..., 0, 0] - inertia[..., 1, 1], inertia[..., [0, 0, 1], [1, 2, 2]]]
    if any(np.abs(part).max() > _STRAIGHT for part in off) or any(np.abs(part).max() > 1e-12 for part in unequal):
        raise UnsupportedSceneError("The backend 'linear' takes links of revolution only: use 'native' for this device.")
    each = np.zeros((count, dofs, len(DOF)))
    each[:, :, :3] = chain.axis
    names = {"stiffness": scope.stiffness, "damping": scope.damping, "armature": scope.armature, "rest": scope.rest,
             "low": scope.low, "high": scope.high}  # fmt: skip
    names |= {name: scope.arms[:, wire] for wire, name in enumerate(WIRE_NAMES)}
    for name, values in names.items():
        each[:, :, DOF.index(name)] = values
    locked = lock_dofs.ravel()
    each[:, locked, DOF.index("behind")] = np.repeat(scope.behind, 2, axis=1)
    each[:, locked, DOF.index("lock_stiffness")] = scope.lock_stiffness
    each[:, locked, DOF.index("lock_damping")] = scope.lock_damping
    body = np.stack([links.offset[..., 2], links.mass, links.centre[..., 2], inertia[..., 0, 0], inertia[..., 2, 2]], -1)
    assert body.shape[-1] == len(BODY)
    own = np.stack([scope.radius, scope.start, scope.tip_place[:, 0, 2], scope.pull_limit, scope.wire_friction,
                    scope.wire_hysteresis], axis=-1)  # fmt: skip
    assert own.shape[-1] == len(SCOPE)
    flat = (part.reshape(count, -1) for part in (each, body, scope.sample_place[..., 2], own))
    return np.concatenate(list(flat), axis=1)


def pack_tables(tables: Tables, real: Any) -> tuple[np.ndarray, np.ndarray]:
    """Rows of stations and of the wall, of colons stacked one after the other."""
    rows = np.zeros((len(tables.points), 4, 4))
    rows[:, 0, :3] = tables.points
    rows[:, 1:, :3] = np.swapaxes(tables.frames, 1, 2)
    return aligned(rows.reshape(-1, STATION), real), aligned(tables.wall, real)


def aligned(values: np.ndarray, real: Any) -> np.ndarray:
    """A copy that begins where vectors of any width may be read."""
    kind = np.dtype(real)
    raw = np.zeros(values.size * kind.itemsize + 64, np.uint8)
    start = -raw.ctypes.data % 64
    copy = raw[start : start + values.size * kind.itemsize].view(kind).reshape(values.shape)
    copy[...] = values
    return copy
