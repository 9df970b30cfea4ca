"""Random scopes in linear time: several worlds of each setting, in colons fixed or hung by random numbers."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.state import Controls
from haustra.errors import HaustraError
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import build_scene
from haustra.quantity import load_quantities
from haustra.scripts.bench.stability.moving import mesentery_ranges
from haustra.scripts.bench.stability.moving_rig import MovingRig, all_finite
from haustra.scripts.bench.stability.random_runs import HOLD
from haustra.scripts.bench.stability.ranges import Range, Setting, build_setting, draw, ranges
from haustra.scripts.bench.stability.rows import Answer, Row

STEPS = (0.001, 0.002, 0.005, 0.007, 0.01, 0.014, 0.02)
"""Time steps [s], of which each setting has the nearest to its own: each takes programs of its own."""
WORLDS = 8
"""Worlds of each setting: as many as a register holds in single precision. They differ in hands, wall and mesentery."""


def wire_ranges() -> tuple[Range, ...]:
    """What counts where wheels steer, from new scopes to worn ones."""
    numbers = load_quantities(asset("numbers/scope.toml"))
    least, most = numbers["scope.adult.tendon_compliance"].low, numbers["scope.worn.compliance"].high
    slack = numbers["scope.worn.slack"]
    return (
        Range("design.wires.compliance", least, most, "m/N", "numbers", log=True),
        Range("design.wires.slack", 0.0, slack.high, slack.unit, "numbers; 0 for a new scope"),
    )


def kind_of(number: int) -> tuple[bool, bool, type]:
    """Whether the colon of a row moves, whether wheels steer, and its precision: all eight kinds in turn."""
    return bool(number % 2), bool(number // 2 % 2), (np.float32, np.float64)[number // 4 % 2]


def begin(folder: str, seed: int, count: int, seconds: float, colons: int) -> Answer:
    """What answers rows in one process."""
    settings = draw((*ranges(), *wire_ranges()), count, seed=seed, beyond=0.0)
    worlds = draw(mesentery_ranges(), count * WORLDS, seed=seed + 1, beyond=0.0)

    @lru_cache(maxsize=colons)
    def rig(number: int) -> MovingRig:
        return MovingRig(load_colon(Path(folder) / f"grown-{number}"), WORLDS)

    def answer(number: int) -> Row:
        rng = np.random.default_rng([seed, number])
        moves, wheels, real = kind_of(number)
        colon, turn, values = int(rng.integers(colons)), rng.standard_normal(3), dict(settings[number])
        step = min(STEPS, key=lambda each: abs(np.log(each / values["scene.timestep"])))
        values["scene.timestep"] = step
        row: Row = {"number": number, "moves": moves, "wheels": wheels, "real": np.dtype(real).name}
        row |= {"colon": colon, "timestep_s": step}
        try:
            setting = build_setting(values, wall_law="table", turn=turn / np.linalg.norm(turn))
            each = worlds[number * WORLDS : (number + 1) * WORLDS]
            backend = _begun(rig(colon), setting, each, moves=moves, real=real)
            return row | _run(backend, _hands(setting, rng, wheels=wheels), seconds)
        except HaustraError as error:
            return row | {"outcome": "refused", "reason": str(error)}

    return answer


def _begun(rig: MovingRig, setting: Setting, each: list[dict[str, float]], *, moves: bool, real: type) -> LinearBackend:
    """A setting's worlds, each on its mesentery and by its wall."""
    options = replace(setting.options, mesentery=moves)
    scene = build_scene(rig.colon, None, setting.design, options, show_lumen=False)
    hung = [{name: value for name, value in one.items() if name.startswith("mesentery.")} for one in each]
    tables = rig.tables(hung) if moves else rig.fixed()
    backend, worlds = LinearBackend(scene, tables, worlds=WORLDS, real=real), np.arange(WORLDS)
    friction, stiffness = (np.array([one[f"world.{name}"] for one in each]) for name in ("friction", "stiffness"))
    backend.reset(worlds, worlds, Conditions(friction, stiffness, np.ones(WORLDS)))
    return backend


def _run(backend: LinearBackend, hands: Iterator[Controls], seconds: float) -> Row:
    """Step until the end, or until a world is lost."""
    count = round(HOLD / backend.scene.options.timestep)
    fastest, begun, finite, alive = 0.0, backend.state().time[0], True, backend.alive
    for _ in range(round(seconds / HOLD)):
        alive = backend.step(next(hands), count)
        fastest = max(fastest, float(np.abs(backend.state().qvel).max()))
        finite &= all_finite(backend)
        if not alive.all():
            break
    state = backend.state()
    backend.close()
    return {
        "outcome": "finished" if alive.all() else "diverged",
        "reason": "",
        "lost": int((~alive).sum()),
        "finite": bool(finite),
        "fastest": fastest,
        "pressing": float((state.normal > 0).mean()),
        "world_steps": round((state.time.max() - begun) / backend.scene.options.timestep) * WORLDS,
    }


def _hands(setting: Setting, rng: np.random.Generator, *, wheels: bool) -> Iterator[Controls]:
    """Mostly inwards, since that is where the wall is; two wires at most, as wheels do; something else each time."""
    most, limit = largest_travel(setting.design), setting.design.wires.pull_limit
    while True:
        push = setting.push_rate * rng.uniform(-0.5, 1.0, WORLDS)
        roll = setting.roll_rate * rng.uniform(-1.0, 1.0, WORLDS)
        sides = setting.pull * rng.uniform(-1.0, 1.0, (WORLDS, 2))
        yield Controls(push, roll, limit * both_ways(sides), most * sides if wheels else None)


def both_ways(sides: Float[np.ndarray, "worlds 2"]) -> Float[np.ndarray, "worlds 4"]:
    """Pulls of four wires that bend towards these sides, up and left where they are positive."""
    return np.concatenate([np.maximum(sides, 0.0), np.maximum(-sides, 0.0)], axis=1)


def largest_travel(design: ScopeDesign) -> float:
    """Wire that a wheel takes up from neutral to a full bend under a full pull [m]."""
    wires, limits = design.wires, design.limits
    bend = np.radians(max(limits.up, limits.left, limits.down, limits.right))
    return float(wires.routing_radius * bend + wires.slack + wires.compliance * wires.pull_limit)
