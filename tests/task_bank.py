"""A bank of two short tubes with a bend, for tests of episodes: an insertion takes seconds."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np

from haustra.envs.learning.recording import Recording
from haustra.envs.sim.native_batch import batch_model
from haustra.envs.tasks.bank import TASK_OPTIONS, ColonSet, make_bank
from haustra.envs.tasks.case import case_of
from haustra.models.devices.scope.library import named_design
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

DESIGN = "paediatric"


COARSE = {"shaft_cell": 0.0625, "bending_cell": 0.034, "twist_hinges": 2, "sample_spacing": 0.0315}


@cache
def short_bank() -> ColonSet:
    """Two short bends, and a scope of coarse cells: what tests ask of episodes does not hang on them."""
    design = named_design(DESIGN)
    colons = [
        swept_colon(winding([(0.08, 0.0), (0.08, turn), (0.12, 0.0)]), name=f"bend {turn}") for turn in (0.6, -0.6)
    ]
    cases = [case_of(colon, device_radius=design.diameter / 2) for colon in colons]
    return make_bank(cases, design, replace(TASK_OPTIONS, **COARSE, insertion_limit=0.32))


@cache
def moving_bank() -> ColonSet:
    """The short bends, the first 60 % of each a sigmoid."""
    cases = [
        replace(case, borders=case.length * np.array([0.0, 0.05, 0.6, 0.7, 0.8, 0.9, 1.0]))
        for case in short_bank().cases
    ]
    return replace(short_bank(), cases=tuple(cases)).with_mesentery(True)


def tip_arcs(recording: Recording) -> np.ndarray:
    """Arc length of the centreline's station nearest to the tip, frame by frame [m], from the joint positions."""
    case, model = short_bank().cases[recording.case], batch_model(short_bank().scene)
    data = mujoco.MjData(model)
    found = []
    for qpos in recording.qpos:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        away = np.linalg.norm(case.points - data.site("scope/tip").xpos, axis=1)
        found.append(case.step * int(away.argmin()))
    return np.array(found)
