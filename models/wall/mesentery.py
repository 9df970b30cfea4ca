"""A colon that gives way: rings of wall pieces on springs, where a mesentery lets the colon move.

Sigmoid and transverse colon hang on a mesocolon; the rest is fixed to the back wall. A mobile stretch is cut into rings
(one for each row of blocks of the wall), each on three slides: sprung to the body by its share of the mesentery, to
its neighbours by the colon's own continuity, and held off from rings of other loops that it lies against. Rings do not
tilt.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.wall import WallPiece


@dataclass(frozen=True)
class Mesentery:
    """How the mobile parts of a colon are held."""

    stiffness: float
    """Spring to the body per length of colon [N/m per m]."""
    spread: float
    """Length over which a point load spreads along the colon [m]."""
    segments: tuple[str, ...] = ("sigmoid", "transverse")
    """Names of the mobile segments."""
    settle_time: float = 0.1
    """Relaxation time of a ring on its spring [s]; engineering choice: slower than contact, faster than a push."""
    ring_mass: float = 1.0
    """Inertia of a ring [kg]; mass scaling, 20 times tissue: its motion is quasi-static, and contacts stay as stiff."""

    def __post_init__(self) -> None:
        for name in ("stiffness", "spread", "settle_time", "ring_mass"):
            if not 0 < getattr(self, name) < 1e6:
                raise InvalidOptionError(f"Mesentery {name} is {getattr(self, name)}; it must be a positive number.")


@dataclass(frozen=True)
class Ring:
    """A mobile row of wall pieces."""

    name: str
    """Name of its body; its slides are `name/x`, `name/y`, `name/z`."""
    start: float
    """Arc length where it begins [m]; the `start` of its pieces."""
    end: float
    """Arc length where it ends [m]."""
    centre: Float[np.ndarray, "3"]
    """Where its body sits at rest: on the centreline [m]."""
    radius: float
    """Median radius of its lumen [m]."""

    @property
    def arc(self) -> float:
        """Arc length of its middle [m]."""
        return (self.start + self.end) / 2

    @property
    def length(self) -> float:
        """Stretch of centreline that it stands for [m]."""
        return self.end - self.start


_AXES = ("x", "y", "z")
_OTHER_LOOP = 0.08
"""Rings further apart along the colon than this belong to different loops [m]."""
_TOUCH = 0.015
"""Loops whose walls are nearer than this push each other [m]."""
_LOOP_CONTACT_STIFFNESS = 2000.0
"""Stiffness between touching loops [N/m]; engineering choice, of the order of two walls in series."""


def add_rings(spec: mujoco.MjSpec, colon: Colon, pieces: Sequence[WallPiece], mesentery: Mesentery) -> tuple[Ring, ...]:
    """Add a body for every mobile row of blocks.

    Args:
        spec: the scene to add to.
        colon: the colon.
        pieces: its wall; pieces with the same `start` stand in one ring.
        mesentery: how it is held.

    Returns:
        The rings, from anus to caecum; rows of pieces that have none are fixed.
    """
    rings = tuple(ring for ring in _rows(colon, pieces) if _segment(colon, ring.arc) in mesentery.segments)
    for ring in rings:
        _add_ring(spec, ring, mesentery)
    for ring, after in pairwise(rings):
        if after.arc - ring.arc < 1.5 * ring.length:
            _couple(spec, ring, after, mesentery)
    for first, second in _touching(rings):
        _hold_off(spec, first, second)
    return rings


def _rows(colon: Colon, pieces: Sequence[WallPiece]) -> Iterator[Ring]:
    line = colon.centreline
    for start, end in sorted({(piece.start, piece.end) for piece in pieces}):
        station = min(int(np.searchsorted(line.arc, (start + end) / 2)), len(line.arc) - 1)
        radius = float(np.median(colon.radius[station]))
        yield Ring(f"colon/ring_{start * 1e3:05.0f}", start, end, line.points[station], radius)


def _segment(colon: Colon, arc: float) -> str:
    return next((segment.name for segment in colon.segments if arc <= segment.end), colon.segments[-1].name)


def _add_ring(spec: mujoco.MjSpec, ring: Ring, mesentery: Mesentery) -> None:
    stiffness = mesentery.stiffness * ring.length
    damping = 2 * np.sqrt(stiffness * mesentery.ring_mass) + stiffness * mesentery.settle_time
    body = spec.worldbody.add_body(name=ring.name, pos=ring.centre)
    body.add_geom(
        name=f"{ring.name}/mass", size=[0.005] * 3, mass=mesentery.ring_mass, contype=0, conaffinity=0, group=5
    )
    for axis, name in enumerate(_AXES):
        body.add_joint(
            name=f"{ring.name}/{name}",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=np.eye(3)[axis],
            stiffness=[stiffness, 0, 0],
            damping=[damping, 0, 0],
        )
    body.add_site(name=f"{ring.name}/centre")


def _couple(spec: mujoco.MjSpec, first: Ring, second: Ring, mesentery: Mesentery) -> None:
    """A spring on the difference of two displacements: w'' EI-like continuity of a string of stiffness k s^2 / ds."""
    stiffness = mesentery.stiffness * mesentery.spread**2 / first.length
    for name in _AXES:
        tendon = spec.add_tendon(name=f"{first.name}~{name}", stiffness=[stiffness, 0, 0])
        tendon.damping = [stiffness * mesentery.settle_time, 0, 0]
        tendon.springlength = [0, 0]
        tendon.wrap_joint(f"{first.name}/{name}", 1.0)
        tendon.wrap_joint(f"{second.name}/{name}", -1.0)


def _touching(rings: Sequence[Ring]) -> Iterator[tuple[Ring, Ring]]:
    for index, first in enumerate(rings):
        for second in rings[index + 1 :]:
            gap = np.linalg.norm(first.centre - second.centre) - first.radius - second.radius
            if abs(first.arc - second.arc) > _OTHER_LOOP and gap < _TOUCH:
                yield first, second


def _hold_off(spec: mujoco.MjSpec, first: Ring, second: Ring) -> None:
    """A spatial spring between centres that acts only when they come nearer than they are at rest."""
    distance = float(np.linalg.norm(first.centre - second.centre))
    tendon = spec.add_tendon(name=f"{first.name}|{second.name}", stiffness=[_LOOP_CONTACT_STIFFNESS, 0, 0])
    tendon.springlength = [distance, 10.0]
    tendon.damping = [1.0, 0, 0]
    tendon.rgba = [0, 0, 0, 0]
    tendon.wrap_site(f"{first.name}/centre")
    tendon.wrap_site(f"{second.name}/centre")
