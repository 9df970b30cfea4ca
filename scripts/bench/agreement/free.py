"""A scope that stands free past the anus: bent by its weight and by a wire, at rest and in motion, on every backend.

Hinges, springs, damping, wires, hand and locks are those of an insertion; only the wall is away.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.at_origin import compile_at_origin
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import Scene, build_scene, entry_of
from haustra.scripts.bench.agreement.row import Agreement

_FREE = 0.3
"""Length past the anus [m]: enough to sag by a third of it."""
_OUTSIDE = 0.05
"""Shaft before the anus [m], held straight."""
_PULL = 15.0
"""Tension of one wire [N]: bends the tip by a right angle."""
_EVERY = 4
"""Time steps between two looks."""
_LOOKS = 250
"""Five seconds, after which motion has died down."""
_TOLERANCE = 1e-5
_REASON = "the same equations; rounding of single precision, 6e-8, may add up over 1000 steps"

Motion = Float[np.ndarray, "looks positions"]
"""Generalised positions of one scope at every look [m, rad]."""


@dataclass(frozen=True)
class Trial:
    """What happens to a scope that is straight at first."""

    what: str
    scene: Scene
    pull: float = 0.0
    """Tension of the wire 'up' in the first half [N]; it is let go for the second."""

    @property
    def model(self) -> mujoco.MjModel:
        """For backends that step MuJoCo's own model."""
        return compile_at_origin(self.scene)

    def pulled(self, look: int) -> float:
        """Pull of the wire before that look [N]."""
        return self.pull if look < _LOOKS // 2 else 0.0


Mover = Callable[[Trial], Motion]


def trials(colon: Colon, design: ScopeDesign) -> tuple[Trial, Trial]:
    """Weight across the scope; and a wire that is pulled and let go. Of the colon nothing is used but its entry."""
    options = replace(BATCH_OPTIONS, start_depth=_FREE, insertion_limit=_FREE + _OUTSIDE)
    axes = entry_of(colon)[1]
    down = axes @ [0.0, -9.81, 0.0]
    across = replace(options, gravity=(float(down[0]), float(down[1]), float(down[2])))
    weight, plain = (build_scene(colon, None, design, each, show_lumen=False) for each in (across, options))
    return Trial("weight", weight), Trial("wire", plain, _PULL)


def natively(trial: Trial) -> Motion:
    """MuJoCo on the CPU, in double precision."""
    model = trial.model
    data, wire = _straight(trial, model)
    seen = []
    for look in range(_LOOKS):
        data.ctrl[wire] = trial.pulled(look)
        mujoco.mj_step(model, data, _EVERY)
        seen.append(data.qpos.copy())
    return np.array(seen)


def by_linear(trial: Trial) -> Motion:
    """The chain in linear time, on the CPU in single precision, with a wall as soft as air."""
    from haustra.envs.sim.conditions import Conditions
    from haustra.envs.sim.linear.backend import LinearBackend
    from haustra.envs.sim.state import Controls

    backend, one = LinearBackend(trial.scene, _open_space(trial.scene), worlds=1), np.ones(1)
    backend.reset(np.zeros(1, int), np.zeros(1, int), Conditions(0 * one, 1e-9 * one, one))
    seen = []
    for look in range(_LOOKS):
        backend.step(Controls(0 * one, 0 * one, np.array([[trial.pulled(look), 0.0, 0.0, 0.0]])), _EVERY)
        seen.append(backend.positions()[0])
    return np.array(seen)


def by_warp(trial: Trial, *, device: str | None = None) -> Motion:
    """MuJoCo Warp, on its device in single precision."""
    import warp as wp
    from mujoco.mjx.third_party import mujoco_warp

    from haustra.envs.sim.warp_setup import use_warp

    use_warp()
    model = trial.model
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # a flag that Warp does not know
    data, wire = _straight(trial, model)
    seen = []
    with wp.ScopedDevice(wp.get_device(device)):
        on_device, worlds = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data, nworld=1)
        for look in range(_LOOKS):
            data.ctrl[wire] = trial.pulled(look)
            worlds.ctrl.assign(data.ctrl[None].astype(np.float32))
            for _ in range(_EVERY):
                mujoco_warp.step(on_device, worlds)
            seen.append(worlds.qpos.numpy()[0].astype(float))
    return np.array(seen)


def compare_free(trial: Trial, movers: Mapping[str, Mover | str]) -> list[Agreement]:
    """Largest distance between tips in motion, and that at rest, for each backend; a text says why one is absent."""
    questions = _questions(trial)
    model, known = trial.model, natively(trial)
    rows = []
    for backend, mover in movers.items():
        if isinstance(mover, str):
            rows += [question.without(backend, mover) for question in questions]
            continue
        apart = np.linalg.norm(_tips(model, mover(trial)) - _tips(model, known), axis=1) / _FREE
        at_rest = apart[_LOOKS // 2 - 1] if trial.pull else apart[-1]
        for question, value in zip(questions, (at_rest, apart.max()), strict=True):
            rows.append(replace(question, backend=backend, difference=float(value)))
    return rows


def _questions(trial: Trial) -> tuple[Agreement, Agreement]:
    """At rest and in motion, asked of nobody yet."""
    names = ("bent by a wire, at rest", "wire pulled and let go") if trial.pull else ("bent by weight", "falling")
    at_rest, moving = (
        Agreement(f"free scope {name}: tip over length", "", _TOLERANCE, "of the length", _REASON) for name in names
    )
    return at_rest, moving


def _straight(trial: Trial, model: mujoco.MjModel) -> tuple[mujoco.MjData, int]:
    """A straight scope with its locks set, and the control of its wire."""
    data, cable = mujoco.MjData(model), trial.scene.cable
    locks = np.array([[model.actuator(name).id for name in pair] for pair in cable.locks])
    data.ctrl[locks] = lock_activation(np, np.float64(_FREE), cable.length - cable.joint_positions)[:, None]
    return data, model.actuator("scope/pull_up").id


def _tips(model: mujoco.MjModel, motion: Motion) -> Float[np.ndarray, "looks 3"]:
    data, tips = mujoco.MjData(model), []
    for qpos in motion:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        tips.append(data.site("scope/tip").xpos.copy())
    return np.array(tips)


def _open_space(scene: Scene):
    """A straight lumen that is as wide as tables can be, from the scene's entry on."""
    from haustra.models.wall.lumen_table import ANGLES, MOST_RADIUS, STATION_STEP, Tables, stack

    count = int(2 * _FREE / STATION_STEP)
    points = np.column_stack([np.zeros((count, 2)), STATION_STEP * np.arange(count)])
    turn = 2 * np.pi * np.arange(ANGLES) / ANGLES
    ring = np.column_stack([np.full(ANGLES, MOST_RADIUS), -np.cos(turn), -np.sin(turn), np.zeros(ANGLES)])
    wall = np.broadcast_to(ring, (count, *ring.shape)).copy()
    frames = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    numbers = (np.float64(STATION_STEP), np.int32(0), np.int32(count))
    axes, radius = entry_of(scene.colon)[1], np.float64(scene.cable.radius)
    return stack([Tables(points, frames, wall, *numbers, axes=axes, device_radius=radius)])
