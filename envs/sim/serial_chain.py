"""A serial chain of slides and hinges as MuJoCo compiled it: how it hangs together, its lengths and its masses."""

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import mujoco
import numpy as np

from haustra.errors import UnsupportedSceneError

Array: TypeAlias = Any


class Links(NamedTuple):
    """Lengths and masses of a chain's links; leading axis: worlds, or 1 where all worlds have the same."""

    offset: Array
    """(worlds, bodies, 3) origin of each body in its parent [m]."""
    mass: Array
    """(worlds, bodies) [kg]."""
    centre: Array
    """(worlds, bodies, 3) centre of mass in the body's frame [m]."""
    inertia: Array
    """(worlds, bodies, 3, 3) about the centre, in the body's frame [kg m^2]."""

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Links":
        """Read a compiled chain, in double precision."""
        bodies = np.arange(1, model.nbody)
        frames = np.array([_matrix(quat) for quat in model.body_iquat[bodies]])
        inertia = np.einsum("bij,bj,bkj->bik", frames, model.body_inertia[bodies], frames)
        parts = (model.body_pos[bodies], model.body_mass[bodies], model.body_ipos[bodies], inertia)
        return cls(*(part.copy()[None] for part in parts))


@dataclass(frozen=True)
class Chain:
    """How a serial chain of slides and hinges hangs together. Bodies are counted without the world."""

    body_of_dof: np.ndarray
    last_dof: np.ndarray
    """(bodies,) index of each body's last dof."""
    hinge: np.ndarray
    """(dofs,) true for hinges, false for slides."""
    axis: np.ndarray
    """(dofs, 3) in the body's frame."""
    turn: np.ndarray
    """(dofs, 3, 3) constant rotation before each dof: that of its body in its parent, at the body's first dof."""

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Chain":
        """Read a chain.

        Raises:
            UnsupportedSceneError: when the model is not one serial chain of slides and hinges at its bodies' origins.
        """
        bodies = np.arange(1, model.nbody)
        kinds = {int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)}
        serial = (model.body_parentid[bodies] == bodies - 1).all() and (model.body_dofnum[bodies] > 0).all()
        if not serial or not set(model.jnt_type.tolist()) <= kinds or np.abs(model.jnt_pos).max(initial=0) > 0:
            raise UnsupportedSceneError(
                "The chain backend takes one serial chain of slides and hinges; this scene has branches, free bodies "
                "or joints off their body's origin: use the native backend."
            )
        first = model.body_dofadr[bodies]
        turn = np.tile(np.eye(3), (model.nv, 1, 1))
        turn[first] = [_matrix(model.body_quat[body]) for body in bodies]
        return cls(
            body_of_dof=model.dof_bodyid - 1,
            last_dof=first + model.body_dofnum[bodies] - 1,
            hinge=model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE,
            axis=model.jnt_axis.copy(),
            turn=turn,
        )


def _matrix(quat: np.ndarray) -> np.ndarray:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)
