"""A scope in a colon that nobody touches: it must only lose energy."""

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.cable import HAND_PUSH, HAND_ROLL
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.result import Criterion
from haustra.scripts.bench.stability.laying import lay_along

INSERTION = 0.25
"""Length of the scope that is laid along the lumen [m]."""
SECONDS = 3.0
EXCESS = 1e-3
"""By how much of what it had at the start a passive scope may hold more: rounding and the planes' motion. Within a run
energy can rise: a contact begins with the step after the one in which it was reached, so that what strikes the wall is
in it by speed times time step, and the wall then holds more than the motion gave."""


def passive_bars(colon: Colon) -> tuple[Criterion, ...]:
    """One criterion: a scope laid along the lumen and let go."""
    return (Criterion("energy of a scope laid in a colon above that at first", excess(colon), EXCESS, "1", "at most"),)


def excess(colon: Colon) -> float:
    """The most energy that a scope laid along the lumen ever has above that at first, over that; 0 when never."""
    energies = settling_energies(colon)
    return float(energies.max() / energies[0] - 1)


def settling_energies(colon: Colon, options: SceneOptions | None = None) -> Float[np.ndarray, " steps"]:
    """Mechanical energy after each step [J]: motion, bend, twist, wall, hand and locks."""
    options = options or SceneOptions(wall_law="planes")
    engine = NativeEngine(build_scene(colon, None, named_design("adult"), options, show_lumen=False))
    lay_along(engine, INSERTION)
    engine.step(Controls(0.0, 0.0), 1)
    energies = []
    for _ in range(round(SECONDS / options.timestep)):
        energies.append(mechanical_energy(engine))
        if not engine.step(Controls(0.0, 0.0), 1):
            return np.array([*energies, np.inf])
    return np.array(energies)


def mechanical_energy(engine: NativeEngine) -> float:
    """Mechanical energy of everything that can give it back [J]."""
    model, data = engine.model, engine.data
    stored = engine.read().energies
    momentum = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    hand = 0.5 * np.array([HAND_PUSH[0], HAND_ROLL[0]]) @ (data.act[:2] - data.qpos[:2]) ** 2
    locks = [i for i in range(model.nu) if model.actuator(i).name.startswith("scope/lock")]
    angles = data.qpos[model.jnt_qposadr[model.actuator_trnid[locks, 0]]]
    held = -0.5 * (data.ctrl[locks] * model.actuator_gainprm[locks, 1]) @ angles**2
    return float(stored.total + stored.twist + 0.5 * data.qvel @ momentum + hand + held)
