"""Question: does a press on a soft wall answer with F = K d, and does it come to rest?

Source: Hooke's law for the wall, as in the colonoscopy simulator that the project implements (its eq. 3).
"""

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.wall.law import WallContact, apply_contact
from haustra.scripts.bench.accuracy.clamped_rod import clamped, uniform_design
from haustra.scripts.bench.accuracy.knobs import (
    Knob,
    Tweak,
    condims,
    cones,
    impedance_ratios,
    integrators,
    solvers,
    unchanged,
    without_step_damping,
)
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, sound, stepping, timed_front

STIFFNESS = 1500.0
"""K of the wall [N/m]."""
JOINTS, LOAD = 20, 3.0
"""Joints of the rod beside the wall, and the press [N]."""
_SETTLING, _READ = 8.0, 0.2
"""Time to come to rest, and time read after that [s]."""
_LOADED = 1e-5
"""Depth from which a contact's stiffness is read [m]."""


def press(link: int, *, load: float, timestep: float, turn: Tweak = unchanged) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A rod beside a wall, one link of it pressed into the wall, after eight seconds."""
    spec, cable = clamped(uniform_design(), JOINTS, timestep=timestep)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    contact = WallContact(stiffness=STIFFNESS, damping=7.5, friction=0.1)
    apply_contact(spec, spec.compile(), cable.geoms, contact, timestep=timestep)
    wall = [0.03, 1.0, 1.0]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=wall, pos=[0.0064 + 0.03, 0, 0], contype=1)
    turn(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body(cable.links[link]).id, 0] = load
    mujoco.mj_step(model, data, round(_SETTLING / timestep))
    return model, data


def contact_stiffness(model: mujoco.MjModel, data: mujoco.MjData) -> Float[np.ndarray, " loaded"]:
    """Normal force over depth of every loaded contact [N/m]."""
    found, wrench = [], np.zeros(6)
    for number in range(data.ncon):
        depth = -data.contact.dist[number]
        if depth > _LOADED:
            mujoco.mj_contactForce(model, data, number, wrench)
            found.append(wrench[0] / depth)
    return np.array(found)


def worst_error(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Largest relative error of the stiffness over the time read: a contact that chatters never has the right one."""
    worst = 0.0
    for _ in range(round(_READ / model.opt.timestep)):
        mujoco.mj_step(model, data)
        found = contact_stiffness(model, data)
        worst = max(worst, float(np.abs(found / STIFFNESS - 1).max()) if len(found) else 1.0)
    return worst if sound(data) else np.inf


def answer(effort: Effort) -> Answer:
    """Sweep time steps and every knob of the solver, pressed at the tip and in the middle."""
    base = 0.004
    same = [Knob(f"timestep={step:g}", "timestep", unchanged) for step in (0.001, 0.002, 0.004, 0.008)]
    bare = without_step_damping(uniform_design().relaxation_time)
    knobs = [*same, *integrators(), bare, *solvers(), *cones(), *condims(1, 4), *impedance_ratios(1, 100)]
    candidates = []
    for knob in knobs:
        effort.tell(f"press on the wall: {knob.setting}")
        step = float(knob.setting.split("=")[1]) if knob.group == "timestep" else base
        runs = [press(link, load=LOAD, timestep=step, turn=knob.turn) for link in (-1, JOINTS // 2)]
        error = max(worst_error(*run) for run in runs)
        fine = np.isfinite(error)
        candidates.append(
            Candidate(knob.setting, error, knob.group, stepping(*runs[0]) if fine else None, _outcome(fine))
        )
    front = timed_front(
        "press on a soft wall",
        candidates,
        reference="F = K d with the K asked for",
        error_unit="largest relative error of K over 0.2 s at rest",
    )
    return Answer([front], notes=[f"Press: {LOAD:g} N at the tip and in the middle, {base} s unless a step is named."])


def _outcome(fine: bool):
    return "completed" if fine else "diverged"
