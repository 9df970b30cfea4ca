"""Forces on a serial chain of joints, and their exact derivative, from MuJoCo's kinematics."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import UnsupportedSceneError


@dataclass(frozen=True)
class Load:
    """A dead load: force and moment keep their direction in space while the body turns."""

    body: int
    """Body that it acts on."""
    point: Float[np.ndarray, "3"]
    """Where, in the body's frame [m]."""
    force: Float[np.ndarray, "3"]
    """In the world frame [N]."""
    moment: Float[np.ndarray, "3"]
    """In the world frame [N m]."""


class SerialChain:
    """Generalised forces of weight, dead loads and joint springs on a chain that hangs together body after body.

    A joint i feels the loads on everything behind it, F_i = sum f_k and T_i = sum (p_k - a_i) f_k^T about its anchor
    a_i. A hinge about w_i takes the torque tau_i = w_i . (axial(T_i) + M_i); turning hinge j >= i by a little turns the
    loads' arms behind it, so d tau_i / d q_j = w_i . (T_j w_j - tr(T_j) w_j); for j < i everything turns as one and the
    same expression holds with i and j exchanged, plus w_j . (w_i x M_i) of the moments, which are not conservative.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Learn the chain's joints.

        Raises:
            UnsupportedSceneError: when the model is not one chain of hinges and slides.
        """
        moving = np.arange(1, model.nbody)
        serial = np.array_equal(model.body_parentid[moving], moving - 1)
        kinds = {mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE}
        if not serial or not set(model.jnt_type) <= {int(kind) for kind in kinds}:
            raise UnsupportedSceneError("Statics needs a single chain of hinges and slides: this model is not one.")
        if model.jnt_stiffnesspoly[:, 0].any():
            raise UnsupportedSceneError("Statics knows springs with a linear and a cubic part: this model has others.")
        self.model = model
        self.body = model.jnt_bodyid.copy()
        self.hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        self.stiffness = np.reshape(model.jnt_stiffness, (model.njnt, -1))[:, 0].copy()
        self.rest = model.qpos_spring.copy()
        self.cubic = model.jnt_stiffnesspoly[:, 1].copy()

    def springs(self, qpos: Float[np.ndarray, " q"]) -> tuple[float, Float[np.ndarray, " q"], Float[np.ndarray, " q"]]:
        """Energy of the joints' springs [J], their torque K q + K3 q^3 against displacement [N m], and its slope."""
        bent = qpos - self.rest
        energy = 0.5 * self.stiffness @ bent**2 + 0.25 * self.cubic @ bent**4
        torque = self.stiffness * bent + self.cubic * bent**3
        return float(energy), torque, self.stiffness + 3 * self.cubic * bent**2

    def place(self, data: mujoco.MjData, qpos: Float[np.ndarray, " q"]) -> None:
        """Move the model to a configuration."""
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)

    def gather(
        self, data: mujoco.MjData, loads: Sequence[Load], gravity: Float[np.ndarray, "3"]
    ) -> tuple[Float[np.ndarray, "joints 3 3"], Float[np.ndarray, "joints 3"], Float[np.ndarray, "joints 3"]]:
        """First moments [N m], resultants [N] and free moments [N m] of the loads behind each joint."""
        force = self.model.body_mass[:, None] * gravity
        first = data.xipos[:, :, None] * force[:, None, :]
        moment = np.zeros((self.model.nbody, 3))
        for load in loads:
            point = data.xpos[load.body] + data.xmat[load.body].reshape(3, 3) @ load.point
            first[load.body] += np.outer(point, load.force)
            force[load.body] += load.force
            moment[load.body] += load.moment
        first, force, moment = (np.cumsum(each[::-1], axis=0)[::-1][self.body] for each in (first, force, moment))
        return first - data.xanchor[:, :, None] * force[:, None, :], force, moment

    def forces(
        self, data: mujoco.MjData, loads: Sequence[Load], gravity: Float[np.ndarray, "3"]
    ) -> tuple[Float[np.ndarray, " q"], Float[np.ndarray, "q q"]]:
        """Generalised force of weight and loads [N, N m], and its derivative by the joint positions."""
        first, force, moment = self.gather(data, loads, gravity)
        axis = data.xaxis.copy()
        axial = np.stack(
            [
                first[:, 1, 2] - first[:, 2, 1],
                first[:, 2, 0] - first[:, 0, 2],
                first[:, 0, 1] - first[:, 1, 0],
            ],
            axis=1,
        )
        turning = np.where(self.hinge[:, None], axial + moment, force)
        value = np.einsum("ij,ij->i", axis, turning)

        trace = np.trace(first, axis1=1, axis2=2)[:, None]
        arms = np.einsum("jab,jb->ja", first, axis) - axis * trace
        # A slide's own force does not depend on what it moves; hinges before it turn its axis: -(w_j x e_i) . F.
        arms[~self.hinge] = 0.0
        upper = np.triu(axis @ arms.T) * self.hinge[:, None]
        lower = np.triu(upper, 1).T
        lower += np.tril(np.cross(axis, np.where(self.hinge[:, None], moment, force)) @ axis.T, -1)
        lower[:, ~self.hinge] = 0.0
        return value, upper + lower

    def jacobian(
        self, data: mujoco.MjData, bodies: Float[np.ndarray, " n"] | np.ndarray, points: Float[np.ndarray, "n 3"]
    ) -> Float[np.ndarray, "n q 3"]:
        """Velocity of points on bodies per joint velocity."""
        turn = np.cross(data.xaxis[None], points[:, None, :] - data.xanchor[None])
        columns = np.where(self.hinge[None, :, None], turn, data.xaxis[None])
        return columns * (self.body[None, :] <= np.asarray(bodies)[:, None])[:, :, None]
