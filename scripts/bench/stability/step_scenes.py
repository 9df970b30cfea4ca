"""What a time step has to stand: a tip let go, a hard push in a narrow bend, an insertion."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment
from haustra.models.anatomy.store import load_colon
from haustra.models.anatomy.tube import tube
from haustra.models.devices.scope.library import named_design
from haustra.models.presets import PRESETS
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.pieces.folder import wall_of
from haustra.provenance import Provenance

INTEGRATORS = {
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "discrete": mujoco.mjtIntegrator.mjINT_DISCRETE,
    "rk4": mujoco.mjtIntegrator.mjINT_RK4,
}
"""MuJoCo's. With `discrete` contacts do not have the stiffness that was asked for (docs/decisions/integrator.md)."""
LARGEST_SPEED = 1000.0
"""Largest generalised speed [rad/s or m/s]; beyond is divergence that the backend has not seen yet."""
VARIANTS = (1.0, 1.1)
"""Pulls of the wires, as a factor: a step counts as stable when it is with each."""
PUSH = 50.0
"""Hard push [N]."""
INTERVAL = 0.02
"""Between two changes of inputs [s], or one time step if that is more."""
BEND = ((0.08, 0.0), (0.1, 1.6), (0.9, 0.0))
"""Length [m] and turn [rad] of the parts of a tube: a bend of 62 mm radius."""
NARROW, WIDE = 0.02, 0.25
"""Radii of tubes [m]: as narrow as a sigmoid, and so wide that a tip let go meets nothing."""
STATION = 0.003
"""Between stations of tubes [m]."""
ANGLES = 32

Act = Iterator[tuple[Controls, float]]
"""Inputs, and for how long [s]."""


class Setting(NamedTuple):
    """One entry of the table."""

    scene: str
    integrator: str
    preset: str


def stays_stable(setting: Setting, timestep: float, grown: Path) -> bool:
    """Whether all variants of the setting run through at that time step [s]; `grown` is the folder of grown colon 0."""
    return all(_runs_through(setting, timestep, grown, pull) for pull in VARIANTS)


def _runs_through(setting: Setting, timestep: float, grown: Path, pull: float) -> bool:
    law = "pieces" if setting.scene.endswith("pieces") else "planes"
    act, colon = SCENES[setting.scene]
    options = replace(PRESETS[setting.preset].apply(SceneOptions()), timestep=timestep, wall_law=law)
    place = colon(grown)
    wall = wall_of(grown, place, "prism") if law == "pieces" else None
    engine = NativeEngine(build_scene(place, wall, named_design("adult"), options, show_lumen=False))
    engine.model.opt.integrator = INTEGRATORS[setting.integrator]
    steps = max(1, round(INTERVAL / timestep))
    for inputs, seconds in act(engine, pull):
        for _ in range(round(seconds / (steps * timestep))):
            if not engine.step(inputs, steps) or np.abs(engine.data.qvel).max() > LARGEST_SPEED:
                return False
    return True


def _release(engine: NativeEngine, pull: float) -> Act:
    limit = engine.scene.design.wires.pull_limit
    yield Controls(0.2, 0.0), 1.5
    yield Controls(0.0, 0.0, np.array([limit * pull / max(VARIANTS), 0.0, 0.0, 0.0])), 0.6
    yield Controls(0.0, 0.0), 0.6


def _push(engine: NativeEngine, pull: float) -> Act:
    """The hand lets itself be pushed along: it would pull the scope back afterwards, at metres a second."""
    yield Controls(0.06, 0.0, pull * np.array([20.0, 8.0, 0.0, 0.0])), 2.5
    engine.data.qfrc_applied[0] = PUSH
    for _ in range(10):
        yield Controls(0.0, 0.0), INTERVAL
        engine.data.act[0] = engine.data.qpos[0]
    engine.data.qfrc_applied[0] = 0.0
    yield Controls(0.0, 0.0), 0.5


def _insertion(engine: NativeEngine, pull: float) -> Act:
    """As fast as hands go, steered this way and that, till the scope jams; and out again."""
    for turn in range(10):
        pulls = np.roll([30.0, 15.0, 0.0, 0.0], turn)
        yield Controls(0.2, 3.0 * (-1) ** turn, pull * pulls), 0.5
    yield Controls(-0.3, 0.0), 1.0


@lru_cache
def _tube(parts: tuple[tuple[float, float], ...], radius: float) -> Colon:
    """A round tube along arcs and straights in the plane z = 0."""
    ends = np.cumsum([0.0, *(length for length, _ in parts)])
    arc = np.linspace(0.0, ends[-1], round(ends[-1] / STATION) + 1)
    heading = np.interp(arc, ends, np.cumsum([0.0, *(turn for _, turn in parts)]))
    tangent = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(len(arc))])
    points = np.cumsum(tangent * np.diff(arc, prepend=0.0)[:, None], axis=0)
    up = np.tile([0.0, 0.0, 1.0], (len(arc), 1))
    frames = np.stack([up, np.cross(tangent, up), tangent], axis=2)
    radii = np.full((len(arc), ANGLES), radius)
    return Colon(
        name="tube",
        lumen=tube(points, frames, radii),
        centreline=Centreline(points, arc, frames),
        radius=radii,
        segments=(ColonSegment("rectum", 0.0, float(arc[-1])),),
        provenance=Provenance(inputs={}, configuration={}),
    )


@lru_cache
def _grown(folder: Path) -> Colon:
    return load_colon(folder)


SCENES: dict[str, tuple[Callable[[NativeEngine, float], Act], Callable[[Path], Colon]]] = {
    "tip release": (_release, lambda grown: _tube(((0.8, 0.0),), WIDE)),
    "push in a bend": (_push, lambda grown: _tube(BEND, NARROW)),
    "insertion": (_insertion, _grown),
    "insertion, pieces": (_insertion, _grown),
}
"""What is done, and where; against tangent planes unless it says pieces."""
