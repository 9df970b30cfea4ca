"""Question: does a rope drawn round a drum resist as Euler and Eytelwein's capstan equation says?"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from haustra.models.wall.law import WallContact, apply_contact
from haustra.scripts.bench.accuracy.knobs import (
    Knob,
    Tweak,
    condims,
    cones,
    impedance_ratios,
    integrators,
    solvers,
    unchanged,
)
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, sound, stepping, timed_front

CELL, ROPE, DRUM = 0.003, 0.002, 0.030
"""Usual length of a link, radius of the rope, and of what it is bent round [m]."""
SPEED, GRIP, HOLD = 0.02, 200.0, 1.0
"""Speed of the hand that draws [m/s], how firmly it keeps that [N s/m], and the force that holds the other end [N]."""
FRICTION = 0.3
_STRAIGHT, _MASS = 0.024, 1 / 3
"""Straight rope on either side [m], and mass per length [kg/m]."""
_SETTLING, _READ = 0.5, 0.4
"""[s]."""
LINKS = (0.006, 0.003, 0.0015)
"""Lengths of a link that are tried [m]."""


@dataclass(frozen=True)
class Drawn:
    """A rope that has been drawn round the drum."""

    model: mujoco.MjModel
    data: mujoco.MjData
    ratio: float
    """Pull over hold; by theory exp(friction x angle)."""


def rope_round_a_bend(
    turn: float, friction: float, *, cell: float = CELL, timestep: float = 0.001, tweak: Tweak = unchanged
) -> Drawn:
    """Draw a rope without stiffness round a drum through an angle `turn` [rad]."""
    spec, names, last = bent_rope(turn, cell=cell, timestep=timestep)
    contact = WallContact(stiffness=1500.0, damping=7.5, friction=friction)
    apply_contact(spec, spec.compile(), names, contact, timestep=timestep)
    drum = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[DRUM, 0.05, 0], conaffinity=0)
    drum.quat = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    tweak(spec)
    return drawn_rope(spec.compile(), last)


def bent_rope(
    turn: float, *, cell: float = CELL, radius: float = ROPE, timestep: float = 0.001
) -> tuple[mujoco.MjSpec, list[str], str]:
    """A rope laid round the y axis at `DRUM` through an angle `turn` [rad]: names of its balls, and of its last body.

    Ball `ball_0`, of that radius [m], is in the middle of body `link_0`, and so on; nothing is there to touch them.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = timestep
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    return spec, *_add_rope(spec, turn, cell, radius)


def drawn_rope(model: mujoco.MjModel, last: str, *, before: Callable[[mujoco.MjData], object] | None = None) -> Drawn:
    """Draw a rope whose last body is held; `before` is called before every step."""
    data, timestep = mujoco.MjData(model), model.opt.timestep
    pulled = model.joint("pull").dofadr[0]
    model.dof_damping[pulled] = GRIP  # a hand that draws at that speed, whatever resists
    mujoco.mj_kinematics(model, data)
    end = model.body(last).id
    data.xfrc_applied[end, :3] = -HOLD * data.xmat[end].reshape(3, 3)[:, 0]
    data.qfrc_applied[pulled] = GRIP * SPEED
    pulls = []
    for _ in range(round((_SETTLING + _READ) / timestep)):
        if before:
            before(data)
        mujoco.mj_step(model, data)
        pulls.append(GRIP * (SPEED - data.qvel[pulled]))
    ratio = float(np.mean(pulls[round(_SETTLING / timestep) :])) / HOLD if sound(data) else np.inf
    return Drawn(model, data, ratio)


def _add_rope(spec: mujoco.MjSpec, turn: float, cell: float, radius: float) -> tuple[list[str], str]:
    """Names of the rope's balls, and of its last body."""
    # Drawn along +x from its first link, which touches the drum's top; the rest lies round it.
    around = DRUM + radius
    straight, bent = round(_STRAIGHT / cell), round(turn * around / cell)
    parent = spec.worldbody.add_body(name="link_0", pos=[straight * cell, 0, around])
    parent.add_joint(name="pull", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    names = []
    for index in range(2 * straight + bent):
        name = f"ball_{index}"
        parent.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0, 0],
            mass=_MASS * cell,
            contype=0,
            conaffinity=1,
        )
        names.append(name)
        angle = turn / bent if straight <= index < straight + bent else 0.0
        parent = parent.add_body(name=f"link_{index + 1}", pos=[-cell, 0, 0])
        parent.quat = [np.cos(angle / 2), 0, -np.sin(angle / 2), 0]
        hinge = parent.add_joint(name=f"hinge_{index}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
        hinge.damping = [1e-5, 0, 0]
    parent.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], mass=_MASS * cell, contype=0, conaffinity=0)
    return names, parent.name


def answer(effort: Effort) -> Answer:
    """Sweep links, time steps and every knob that friction may depend on, a quarter turn."""
    cells = [Knob(f"link={size:g}", "links", unchanged) for size in ((0.006, 0.003) if effort.quick else LINKS)]
    steps = [Knob(f"timestep={step:g}", "timestep", unchanged) for step in (0.0005, 0.002, 0.004)]
    few = [*cones(), *condims(1)]
    many = [*integrators(), *solvers(), *cones(), *condims(1, 4, 6), *impedance_ratios(1, 100)]
    exact = float(np.exp(FRICTION * np.pi / 2))
    candidates = []
    for knob in (*cells, *steps, *(few if effort.quick else many)):
        effort.tell(f"capstan: {knob.setting}")
        size = float(knob.setting.split("=")[1]) if knob.group in ("links", "timestep") else 0.0
        drawn = rope_round_a_bend(
            np.pi / 2,
            FRICTION,
            cell=size if knob.group == "links" else CELL,
            timestep=size if knob.group == "timestep" else 0.001,
            tweak=knob.turn,
        )
        fine = np.isfinite(drawn.ratio)
        block = stepping(drawn.model, drawn.data) if fine else None
        error = abs(drawn.ratio / exact - 1)
        candidates.append(Candidate(knob.setting, error, knob.group, block, "completed" if fine else "diverged"))
    front = timed_front(
        "rope drawn round a quarter turn, friction 0.3",
        candidates,
        reference="capstan equation, exp(mu x angle)",
        error_unit="relative error of the pull",
    )
    return Answer([front], notes=["Capstan: links of 3 mm and 1 ms unless named, since they are short and light."])
