"""Whether a scope's tip stays inside a colon: random pushes, against pieces of wall or against tangent planes."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Colon
from haustra.models.scene import add_wall
from haustra.models.wall.law import WallContact, apply_contact
from haustra.models.wall.pieces.wall import Wall
from haustra.models.wall.planes import PlaneWall, add_planes, capsule_samples
from haustra.models.wall.signed_distance import LumenDistance

Law = Literal["pieces", "planes"]
RADIUS, HALF, MASS = 0.0064, 0.010, 0.010
"""Radius, half length of the axis [m] and mass [kg] of a stiff tip of an adult scope: 33 mm long."""
LARGEST_FORCE, LARGEST_SPEED = 20.0, 0.3
"""Largest force [N] and speed [m/s] of a push."""
ALLOWANCE = 0.001
"""How far beyond the Hookean depth the surface may stand outside [m]: the wall's geometric error."""
CONTACT = WallContact(stiffness=1500.0, damping=7.5, friction=0.1)
"""As in scenes."""
TIMESTEP = 0.005
PUSH_TIME = 0.8
"""Time of a push [s]: at full speed it would move the tip by 0.24 m."""
SETTLE_TIME = 1.0
"""How much longer a tip is pushed that is too deep in the end [s]. One that strikes the wall at 0.3 m/s just then goes
in by v sqrt(m / K) = 0.8 mm more than pressed, and comes back; one that has got out stays out."""
TURN_DAMPING = 2e-3
"""Resistance of the tip to turning [N m s/rad]; engineering choice: the shaft behind it."""
FROM_ANUS, FROM_CAECUM = 0.26, 0.03
"""Least arc length of a start from either end [m]: a push must not end before the anus, where there is no wall."""
CLEARANCE = 0.0005
"""Room of a start around the tip [m]."""
TRIES = 200
"""Starts looked at for each push before one is taken that does not fit."""


@dataclass(frozen=True)
class Push:
    """One push and its end."""

    arc: float
    """Where it began [m]."""
    force: float
    """[N]."""
    travelled: float
    """How far the tip has moved [m]."""
    outside: float
    """How far its surface stands outside the lumen at the end, at most [m]."""
    pressing: float
    """Force over stiffness: the Hookean depth of a single contact [m]."""

    @property
    def escaped(self) -> bool:
        """Whether it stands further outside than Hooke's law and the wall's error allow."""
        return not self.outside <= self.pressing + ALLOWANCE


class Pushes:
    """A tip in a colon's wall, which can be pushed again and again."""

    def __init__(self, colon: Colon, wall: Wall | None) -> None:
        """Against the pieces of `wall`, or against tangent planes when it is None."""
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.option.timestep = TIMESTEP
        spec.option.gravity = [0, 0, 0]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD | mujoco.mjtDisableBit.mjDSBL_AUTORESET
        body = spec.worldbody.add_body(name="tip")
        body.add_freejoint(name="tip")
        ends = [0, 0, -HALF, 0, 0, HALF]
        body.add_geom(name="tip", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, size=[RADIUS, 0, 0], mass=MASS)
        geom = spec.geom("tip")
        geom.contype, geom.conaffinity = 0, 1 if wall else 0
        bare = spec.compile()
        self._samples = capsule_samples(bare, ["tip"], spacing=RADIUS)
        # The spheres of the planes also tell where the tip's surface is.
        add_planes(spec, bare, self._samples, CONTACT, timestep=TIMESTEP)
        if wall:
            for pair in spec.pairs:
                pair.margin = -1.0  # they touch nothing here
            apply_contact(spec, bare, ["tip"], CONTACT, timestep=TIMESTEP)
            add_wall(spec, wall)
        self._planes = wall is None
        self._model = spec.compile()
        self._field = LumenDistance(colon)
        self._colon = colon

    def push(self, rng: np.random.Generator) -> Push:
        """One push from a random place in a random direction."""
        data = mujoco.MjData(self._model)
        arc, position, turn = self._start(rng)
        data.qpos[:3], data.qpos[3:] = position, turn
        mujoco.mj_kinematics(self._model, data)
        around = PlaneWall(self._model, self._field, arcs=np.full(len(self._samples), arc))
        force = LARGEST_FORCE * (1 - rng.random())
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        outside = around.update(data)
        pressing = force / CONTACT.stiffness
        for step in range(round((PUSH_TIME + SETTLE_TIME) / TIMESTEP)):
            if step >= round(PUSH_TIME / TIMESTEP) and (outside + RADIUS).max() <= pressing + ALLOWANCE:
                break
            # A hand of that force that moves no faster than the largest speed.
            drag = force / LARGEST_SPEED
            data.xfrc_applied[1, :3] = force * direction
            data.xfrc_applied[1, 3:] = 0.0
            self._model.dof_damping[:3], self._model.dof_damping[3:] = drag, TURN_DAMPING
            mujoco.mj_step(self._model, data)
            outside = around.update(data)
            if not np.isfinite(data.qpos).all():
                return Push(arc, force, np.inf, np.inf, pressing)
        travelled = float(np.linalg.norm(data.qpos[:3] - position))
        return Push(arc, force, travelled, float((outside + RADIUS).max()), pressing)

    def _start(self, rng: np.random.Generator) -> tuple[float, Float[np.ndarray, " 3"], Float[np.ndarray, " 4"]]:
        """Arc length, position and orientation along the centreline, where the tip fits into the lumen."""
        line = self._colon.centreline
        inner = np.flatnonzero((line.arc > FROM_ANUS) & (line.arc < line.length - FROM_CAECUM))
        turn = np.zeros(4)
        station = inner[0]
        for _ in range(TRIES):
            station = rng.choice(inner)
            mujoco.mju_mat2Quat(turn, line.frames[station].ravel())
            axis = line.frames[station][:, 2]
            places = line.points[station] + np.linspace(-HALF, HALF, 3)[:, None] * axis
            feet = self._field.nearest(places, np.full(3, line.arc[station]))
            if (feet.outside < -RADIUS - CLEARANCE).all():
                break
        return float(line.arc[station]), line.points[station].copy(), turn


def random_pushes(
    colon: Colon,
    wall: Wall | None,
    *,
    count: int,
    seed: int,
    progress: Callable[[int], None] = lambda done: None,
) -> tuple[Push, ...]:
    """Push a tip `count` times, each from another random place; `wall` None stands for tangent planes."""
    rig = Pushes(colon, wall)
    rng = np.random.default_rng(seed)
    found = []
    for number in range(count):
        found.append(rig.push(rng))
        progress(number + 1)
    return tuple(found)


def summary(pushes: tuple[Push, ...]) -> dict[str, Any]:
    """Figures of a series of pushes, as JSON values."""
    beyond = np.array([push.outside - push.pressing for push in pushes]) * 1e3
    return {
        "pushes": len(pushes),
        "escaped": sum(push.escaped for push in pushes),
        "beyond_hookean_depth_max_mm": float(beyond.max()),
        "beyond_hookean_depth_p99_mm": float(np.percentile(beyond, 99)),
        "travelled_median_mm": float(np.median([push.travelled for push in pushes]) * 1e3),
    }
