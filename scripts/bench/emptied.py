"""How long virtual patients' colons are when their gas is sucked out, over their length with it."""

import numpy as np
from jaxtyping import Float

from haustra.envs.study.clinic_gas import PatientsGas
from haustra.envs.study.cohort import cohort_study, patient_of
from haustra.envs.study.cohort_batch import tables_with_mesentery
from haustra.envs.study.patients import Patient
from haustra.envs.study.sampling import designs_of
from haustra.models.devices.scope.library import named_design
from haustra.models.wall.lumen_table import stack
from haustra.models.wall.moving_colon import shape_of
from haustra.models.wall.table_wall import TableWalls

_STEP, _STEPS = 0.02, 2000
"""Time step [s], and how many: 40 s, in which a colon comes to rest."""


def emptied_lengths(patients: int, *, seed: int = 0) -> Float[np.ndarray, " patients"]:
    """Length of the axis of each of so many patients' colons at rest without gas, over that with it [1]."""
    study = cohort_study("full", patients=patients, seed=seed)
    return np.array([_emptied_length(patient_of(study, values)) for values in designs_of(study)])


def _emptied_length(patient: Patient) -> float:
    colon, radius = patient.colon(), named_design("adult").diameter / 2
    lost = PatientsGas([colon])(np.ones(1, bool), np.inf)
    tables = stack([tables_with_mesentery(patient, colon, radius, rooted=True)[0]])
    assert tables.mesentery is not None
    own = tables.mesentery._replace(pressure_lost=lost)
    walls = TableWalls(tables._replace(mesentery=own), 1, 1, radius=radius)
    assert walls.displacement is not None
    nothing = np.zeros((1, 0)), np.zeros((1, 0, 3)), np.zeros((1, 0, 3)), np.zeros((1, 0, 2))
    for _ in range(_STEPS):
        walls.move(np.zeros(1, int), nothing, _STEP)
    return float(shape_of(np, own, walls.displacement.pose).lengths.sum() / own.lengths.sum())
