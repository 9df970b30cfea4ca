"""Question: how far does the bending section bend for a pull?

Source: constant curvature under an eccentric pull, angle = F r l / EI (Rucker and Webster, IEEE T-RO 27 (2011) 1033).
"""

import mujoco
import numpy as np

from haustra.scripts.bench.accuracy.clamped_rod import EI, LENGTH, clamped, settle, uniform_design
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, stepping, timed_front

PULL, ARM, SECTION = 30.0, 0.005, LENGTH / 2
"""Pull [N], the wires' distance from the axis and length of the bending section [m]: 72 degrees."""


def bend_error(joints: int, share: float, *, timestep: float = 0.004) -> tuple[float, mujoco.MjModel, mujoco.MjData]:
    """Relative error of the tip's angle when wires 'up' and 'left' share a pull; `share` of a right angle from 'up'."""
    spec, _ = clamped(uniform_design(), joints, timestep=timestep)
    model = spec.compile()
    data = mujoco.MjData(model)
    turn = share * np.pi / 2
    data.actuator("scope/pull_up").ctrl = PULL * np.cos(turn)
    data.actuator("scope/pull_left").ctrl = PULL * np.sin(turn)
    settle(model, data)
    # Where the tip looks: angle between its axis and that of the straight section.
    axis = data.site("scope/tip").xmat.reshape(3, 3)[:, 2]
    angle = float(np.arccos(np.clip(axis[2], -1, 1)))
    return abs(angle / (PULL * ARM * SECTION / EI) - 1), model, data


def answer(effort: Effort) -> Answer:
    """Sweep joints, half of them in the bending section, and the time step; pulled between two wires."""
    candidates = []
    counts = (4, 8, 16, 32) if effort.quick else (4, 8, 16, 32, 64)
    for group, joints, step in (
        *(("joints", joints, 0.004) for joints in counts),
        *(("timestep", 16, step) for step in (0.002, 0.008)),
    ):
        effort.tell(f"wires: {joints} joints, {step} s")
        error, model, data = max(
            (bend_error(joints, share, timestep=step) for share in (0.25, 0.5)), key=lambda e: e[0]
        )
        setting = f"joints in the section={joints // 2}, timestep={step:g}"
        candidates.append(Candidate(setting, error, group, stepping(model, data)))
    front = timed_front(
        "bend for a pull between two wires",
        candidates,
        reference="constant curvature, F r l / EI",
        error_unit="relative error of the angle",
    )
    return Answer([front])
