"""Equilibrium of a scope in a colon without stepping time, after the simulator paper (its eq. 6 to 9).

The total energy, E_c of the bent scope plus E_b of the pressed wall, is minimised for a given insertion, roll and pull.
The paper finds collisions once per iteration and then lets each wall force F fall with the displacement a of its place,
F' = F (1 - eta a / |F|): a spring of stiffness eta instead of the wall's k. Here each iteration finds the contacts,
solves the scope against such springs, and repeats until nothing moves; then a = 0 and F = k d whatever eta is. A larger
eta is slower and surer. Friction plays no part: with it, an equilibrium is not unique.
"""

import time
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.physics.stops import stop_torque
from haustra.models.devices.scope.stops import STOP_STIFFNESS
from haustra.scripts.bench.reference.chain import SerialChain
from haustra.scripts.bench.reference.descent import find_minimum
from haustra.scripts.bench.reference.newton import NoEquilibriumError

_HELD = 2
"""Joints that the hand holds: push and roll."""

_MARGIN = 0.01
"""Gaps up to this count as contacts that do not push yet [m]: the scope must not move through a wall unseen."""

_STRIDE = 0.004
"""No place of the scope moves further in one iteration [m]: what was found holds only near by."""

_STILL = 1e-6
"""Iterations end when no place of contact moves further than this [m]; 1/1000 of the criterion of 1 mm."""


@dataclass(frozen=True)
class _Contacts:
    """Places where scope and wall overlap, as found once."""

    body: np.ndarray
    place: np.ndarray
    """In the body's frame [m]."""
    point: np.ndarray
    normal: np.ndarray
    """Out of the wall, into the scope."""
    depth: np.ndarray
    """Overlap d; negative for a gap [m]."""


@dataclass(frozen=True)
class Settled:
    """An equilibrium in the colon."""

    qpos: Float[np.ndarray, " q"]
    iterations: int
    """Times that contacts were found."""
    newton_steps: int
    """Linear systems solved in all."""
    seconds: float
    """Processor time that it took [s]."""
    bending_energy: float
    """E_c [J]."""
    wall_energy: float
    """E_b [J]."""


def settle(engine: NativeEngine, *, feedback: float = 2.0, most_iterations: int = 400) -> Settled:
    """Move a scene's scope into equilibrium with the wall at its present insertion, roll and pulls, without friction.

    Args:
        engine: the scene; its state is where the search starts, and is left in equilibrium at rest.
        feedback: eta over the wall's stiffness [1]; the paper used 2 to 15.
        most_iterations: give up after so many.

    Raises:
        NoEquilibriumError: when the scope does not come to rest within `most_iterations`.
        UnsupportedSceneError: when something else in the scene moves.
    """
    began = time.process_time()
    search = _Search(engine, feedback)
    newton_steps, moved = 0, np.inf
    for iteration in range(1, most_iterations + 1):
        contacts = search.find_contacts()
        steps, moved = search.solve(contacts)
        newton_steps += steps
        if moved < _STILL:
            data = engine.data
            data.qvel[:] = 0
            mujoco.mj_forward(engine.model, data)
            energies = engine.read().energies
            spent = time.process_time() - began
            return Settled(data.qpos.copy(), iteration, newton_steps, spent, energies.bending, energies.wall)
    raise NoEquilibriumError(
        f"The scope still moves by {moved * 1e3:.2g} mm after {most_iterations} iterations: raise feedback."
    )


class _Search:
    """The scope's energy for contacts that were found once."""

    def __init__(self, engine: NativeEngine, feedback: float) -> None:
        self.model, self.data = engine.model, engine.data
        self.chain = SerialChain(self.model)
        self.stiffness = engine.scene.options.wall_stiffness
        self.eta = feedback * self.stiffness
        self.gravity = self.model.opt.gravity.copy()
        self.lock, self.pull = self._actuators()
        self.limited = np.flatnonzero(self.model.jnt_limited)

    def _actuators(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness of locks and constant torque of wires, per joint, from the controls as they are."""
        model, data = self.model, self.data
        lock, pull = np.zeros(model.nq), np.zeros(model.nq)
        mujoco.mj_forward(model, data)
        for index in range(model.nu):
            name = model.actuator(index).name
            if name.startswith("scope/lock"):
                lock[model.actuator_trnid[index, 0]] = -model.actuator_gainprm[index, 1] * data.ctrl[index]
            elif name.startswith("scope/pull"):
                moment = np.zeros(model.nv)
                tendon = model.actuator_trnid[index, 0]
                start, count = model.tendon_adr[tendon], model.tendon_num[tendon]
                joints = model.wrap_objid[start : start + count]
                moment[joints] = -model.wrap_prm[start : start + count]
                pull += data.ctrl[index] * moment
        return lock, pull

    def find_contacts(self) -> _Contacts:
        """Let MuJoCo find where scope and wall overlap."""
        data, model = self.data, self.model
        margin = model.geom_margin.copy()
        model.geom_margin[model.geom_bodyid > 0] = _MARGIN
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        model.geom_margin[:] = margin
        contact = data.contact
        touching = contact.dist < _MARGIN
        geoms = contact.geom[touching]
        bodies = model.geom_bodyid[geoms]
        second = bodies[:, 1] > bodies[:, 0]
        body = bodies.max(axis=1)
        normal = contact.frame[touching, :3] * np.where(second, 1.0, -1.0)[:, None]
        point = contact.pos[touching]
        turned = data.xmat[body].reshape(-1, 3, 3)
        place = np.einsum("cji,cj->ci", turned, point - data.xpos[body])
        return _Contacts(body, place, point.copy(), normal, -contact.dist[touching])

    def solve(self, contacts: _Contacts) -> tuple[int, float]:
        """Newton steps taken, and how far the furthest joint moved [m]."""
        before = self.data.xanchor.copy()
        held = self.data.qpos[:_HELD].copy()

        def potential(free: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
            energy, force, tangent = self._energy(np.concatenate([held, free]), contacts)
            return energy, force[_HELD:], tangent[_HELD:, _HELD:]

        scale = float(self.chain.stiffness.max())
        start = self.data.qpos[_HELD:].copy()
        found = find_minimum(potential, start, scale=scale, tolerance=1e-7, largest_step=0.1)
        self.chain.place(self.data, np.concatenate([held, found.qpos]))
        moved = float(np.abs(self.data.xanchor - before).max())
        if moved > _STRIDE:
            part = start + _STRIDE / moved * (found.qpos - start)
            self.chain.place(self.data, np.concatenate([held, part]))
        return found.iterations, moved

    def _energy(self, qpos: np.ndarray, contacts: _Contacts) -> tuple[float, np.ndarray, np.ndarray]:
        chain, data = self.chain, self.data
        chain.place(data, qpos)
        value, slope = chain.forces(data, [], self.gravity)
        energy, force, diagonal = chain.springs(qpos)
        energy += 0.5 * self.lock @ qpos**2 - self.pull @ qpos
        energy -= float(self.model.body_mass @ data.xipos @ self.gravity)
        force = force + self.lock * qpos - self.pull - value
        diagonal = diagonal + self.lock

        low, high = self.model.jnt_range[self.limited].T
        stops, _ = stop_torque(np, qpos[self.limited], low, high, timestep=0.0)
        energy += 0.5 * stops @ stops / STOP_STIFFNESS
        force[self.limited] -= stops
        diagonal[self.limited] += STOP_STIFFNESS * (stops != 0)
        tangent = np.diag(diagonal) - slope
        if len(contacts.body) == 0:
            return float(energy), force, tangent

        frames = data.xmat[contacts.body].reshape(-1, 3, 3)
        points = data.xpos[contacts.body] + np.einsum("cij,cj->ci", frames, contacts.place)
        moving = np.einsum("cqi,ci->cq", chain.jacobian(data, contacts.body, points), contacts.normal)
        away = np.einsum("ci,ci->c", points - contacts.point, contacts.normal)
        # Where they overlapped, k d falls with eta; across a gap the wall begins to push where the gap closes.
        first = np.where(contacts.depth > 0, self.stiffness, self.eta) * contacts.depth
        pushing = np.maximum(first - self.eta * away, 0.0)
        energy += float(pushing @ pushing) / (2 * self.eta)
        force -= moving.T @ pushing
        tangent += self.eta * (moving * (pushing > 0)[:, None]).T @ moving
        return float(energy), force, tangent
