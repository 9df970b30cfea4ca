"""The reference of the backend 'linear': the same implicit step by MuJoCo's own dense matrices, in double precision.

Mass matrix, bias and the Jacobians of places are MuJoCo's, the matrix is formed and solved by numpy, and springs,
wires, hand, locks and the wall are the laws that every backend calls. Wires that wheels steer are solved for by a dense
solve a wire, and pairs of them in turn until nothing changes. One world after the other: for tests.
"""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.at_origin import compile_at_origin
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.physics.hand import HAND_DAMPING, hand_force
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.physics.stops import stop_torque
from haustra.envs.sim.physics.wires import borne_pulls, sheath_angle, sprung_pulls, wheel_pulls
from haustra.envs.sim.scope_colon_set import ScopeColonSet
from haustra.envs.sim.scope_reading import read_chain, read_scope
from haustra.envs.sim.scope_values import State
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.wires import arriving_pulls, passed_part, travel_of_wheels
from haustra.models.wall import moving_colon, threads
from haustra.models.wall.elasticity import ELASTICITIES
from haustra.models.wall.law import implicit_contact
from haustra.models.wall.lumen_table import pick, query
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement

_ROUNDS = 50
"""Rounds in which pairs of wires are solved for: far more than rounding needs."""


class DenseStep:
    """Steps worlds of one scope, whose springs are as designed, in colons without gravity."""

    def __init__(self, bank: ScopeColonSet, colon: Int[np.ndarray, " worlds"], conditions: Conditions) -> None:
        """Take a scope, which colon each world has, and its wall.

        Raises:
            UnsupportedSceneError: when the scene has what the backend 'linear' cannot honour.
        """
        self._model = compile_at_origin(bank.scene)
        self._data = mujoco.MjData(self._model)
        self._chain = read_chain(bank.scene, backend="linear")
        self._scope = read_scope(bank.scene, backend="linear")
        self._tables, self._options, self._wall = pick(bank.tables, colon), bank.scene.options, conditions

    def step(self, now: State, hands: Controls) -> tuple[Float[np.ndarray, "worlds dofs"], AxisDisplacement | None]:
        """Speeds of joints after a step [m/s, rad/s], and where colons that move are then."""
        scope, tables, h = self._scope, self._tables, self._options.timestep
        matrix, bias, centres, tip, jacobians = self._dynamics(now.qpos, now.qvel)
        places = np.concatenate([centres, tip], axis=1)
        if now.displacement is None or tables.mesentery is None:
            found, grip = query(np, tables, places, now.arcs), None
        else:
            about = tables, now.displacement, places, now.arcs, scope.radius
            found, grip = moving_colon.query(np, *about, threaded=places.shape[1])
            grip = AttachmentPoints(grip.arcs[:, :-1], grip.lever[:, :-1])
        inwards = found.inwards[:, :-1]
        # Of the surface: centres move by the first part, and the second says how links turn.
        surface = -scope.radius[:, None, None] * inwards
        moves = jacobians[0] + np.cross(jacobians[1], surface[..., None], axis=2)
        still = np.zeros_like(inwards)
        if grip is not None and tables.mesentery is not None and now.displacement is not None:
            still = moving_colon.wall_speeds(np, tables.mesentery, now.displacement, grip)
        options = self._options
        law = implicit_contact(
            np,
            found.depth[:, :-1] + scope.radius[:, None] - tables.device_radius,
            inwards,
            np.einsum("wpid,wd->wpi", moves, now.qvel) - still,
            now.normal > 0,
            stiffness=self._wall.wall_stiffness[:, None],
            ahead=options.wall_damping_time + h,
            friction=self._wall.friction[:, None],
            friction_rise=options.friction_rise,
            elasticity=ELASTICITIES[options.elasticity],
        )
        force = law.force(np, np.einsum("wpid,wd->wpi", moves, now.qvel) - still)
        torque, damping = self._joints(now, hands)
        torque = torque - bias + np.einsum("wpid,wpi->wd", moves, force)
        drawn = None
        if tables.mesentery is not None and now.displacement is not None:
            drawn = threads.drawn(np, tables.mesentery, now.displacement.pose, centres, found.arcs[:, :-1])
            torque = torque + np.einsum("wpid,wpi->wd", jacobians[0], drawn.borne)
            torque = torque + np.einsum("wpid,wpi->wd", jacobians[1], drawn.moment)
        matrix = matrix + h * np.einsum("wpid,wpij,wpje->wde", moves, law.damping(np), moves)
        matrix = matrix + h * damping[:, None] * np.eye(damping.shape[1])
        if hands.wheels is not None:
            torque = torque - self._wires(now, np.asarray(hands.wheels), matrix, torque)
        speeds = now.qvel + h * np.linalg.solve(matrix, torque[..., None])[..., 0]
        if grip is None or tables.mesentery is None or now.displacement is None:
            return speeds, None
        pressed = -law.force(np, np.einsum("wpid,wd->wpi", moves, speeds) - still)
        axes = now.displacement, grip, pressed, np.stack([law.damper, law.drag], axis=-1)
        return speeds, moving_colon.step_axis(np, tables.mesentery, *axes, h, drawn=drawn)

    def _dynamics(self, qpos: np.ndarray, qvel: np.ndarray) -> tuple[Any, ...]:
        """Mass matrix, bias, centres of the spheres, tip, and Jacobians of both kinds, of all worlds."""
        model, data, body = self._model, self._data, self._chain.sample_body + 1
        local = self._scope.sample_place[0]
        rows: list[tuple[np.ndarray, ...]] = []
        for place, speed in zip(qpos, qvel, strict=True):
            data.qpos[:], data.qvel[:] = place, speed
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            full = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, full)
            frames = data.xmat.reshape(-1, 3, 3)
            centres = data.xpos[body] + np.einsum("pij,pj->pi", frames[body], local)
            jacobians = np.zeros((2, len(body), 3, model.nv))
            for index, centre in enumerate(centres):
                mujoco.mj_jac(model, data, jacobians[0, index], jacobians[1, index], centre, int(body[index]))
            tip = data.xpos[-1:] + self._scope.tip_place[0] @ frames[-1].T
            rows.append((full, data.qfrc_bias.copy(), centres, tip, jacobians))
        matrix, bias, centres, tip, jacobians = (np.stack(part) for part in zip(*rows, strict=True))
        return matrix, bias, centres, tip, np.moveaxis(jacobians, 1, 0)

    def _joints(self, now: State, hands: Controls) -> tuple[np.ndarray, np.ndarray]:
        """Torques of springs, stops, locks, hand and wires, and the damping that goes into the matrix."""
        scope, chain = self._scope, self._chain
        stops, stopped = stop_torque(np, now.qpos, scope.low, scope.high, timestep=self._options.timestep)
        bent = now.qpos - scope.rest
        torque, damping = stops - scope.stiffness * bent - scope.cubic * bent**3, scope.damping + stopped
        held = np.repeat(lock_activation(np, scope.start[:, None] + now.qpos[:, :1], scope.behind), 2, axis=1)
        dofs = chain.lock_dofs.ravel()
        torque[:, dofs] -= scope.lock_stiffness * held * now.qpos[:, dofs]
        damping[:, dofs] += scope.lock_damping * held
        if hands.wheels is None:
            arrived = arriving_pulls(np, hands.pulls, now.pulls, **self._losses(now))
            torque -= (borne_pulls(np, arrived, scope.pull_limit[:, None])[:, None] @ scope.arms)[:, 0]
        torque -= damping * now.qvel
        limits = np.tile([self._options.push_limit, self._options.torque_limit], (len(torque), 1))
        hand = hand_force(np, now.hand, now.qpos[:, :2], now.qvel[:, :2], limits)
        # The hand's damper is in its force already; where the force is at its limit, it damps no more.
        torque[:, :2] += hand
        damping[:, :2] += np.where(np.abs(hand) < limits, HAND_DAMPING, 0.0)
        return torque, damping

    def _losses(self, now: State) -> dict[str, Any]:
        """What `arriving_pulls` asks of wires and shaft."""
        about_x, about_y = self._chain.shaft_dofs
        return {
            "friction": self._scope.wire_friction[:, None],
            "hysteresis": self._scope.wire_hysteresis[:, None],
            "sheath_angle": sheath_angle(np, now.qpos[:, about_x], now.qpos[:, about_y])[:, None],
        }

    def _wires(self, now: State, wheels: np.ndarray, matrix: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Torques of wires that are springs, with the stretch that is left at the step's end."""
        scope, h = self._scope, self._options.timestep
        arms, losses, travel = scope.arms[0], self._losses(now), travel_of_wheels(wheels)
        wires = {"compliance": scope.wire_compliance[:, None], "limit": scope.pull_limit[:, None]}
        stretch = travel - scope.wire_slack[:, None] + now.qpos @ arms.T
        before = arriving_pulls(np, wheel_pulls(np, stretch, **wires), now.pulls, **losses)
        one = {name: each[:, 0] for name, each in wires.items()} | {"part": passed_part(np, **losses)[:, 0]}
        moved = np.linalg.solve(matrix, np.tile(arms[:2].T, (len(torque), 1, 1)))  # by a newton of each pair
        give = h * h * np.einsum("jd,wdk->wjk", arms[:2], moved)
        free = now.qvel + h * np.linalg.solve(matrix, torque[..., None])[..., 0]
        ends = travel[:, :2] + (now.qpos + h * free) @ arms[:2].T
        pulls = sprung_pulls(
            np,
            tuple(before.T),
            (ends[:, 0], ends[:, 1]),
            (give[:, 0, 0], give[:, 0, 1], give[:, 1, 1]),
            slack=scope.wire_slack,
            rounds=_ROUNDS,
            **one,
        )
        return np.stack(pulls, axis=1) @ arms
