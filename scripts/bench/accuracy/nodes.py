"""Question: what does a physics step cost against the number of nodes, in a colon of 623,805 triangles?

Bars: a tenth of the collision-response time that the colonoscopy simulator's authors print for their scene, and an
exponent of 1.3 at most. Every node is modelled, wherever it is; beside it stands what the same push costs where shaft
and wall that it cannot reach are left out, as a run does by default. Two backends: MuJoCo's against the wall's pieces,
and the chain in linear time against the tabulated lumen.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.sim.backend import SingleBackend
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import PRESETS
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.pieces.build import build_wall
from haustra.scripts.bench.accuracy.drive import steady_push
from haustra.scripts.bench.accuracy.places import grown
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.refined_mesh import with_triangles
from haustra.scripts.bench.accuracy.timing import Block, in_turns, processor_seconds, stepping
from haustra.scripts.bench.cost import options_for
from haustra.scripts.bench.result import Criterion, Table, Value

TRIANGLES = 623_805
"""Number of triangles in the published scene."""
RESPONSE_MS: Mapping[int, float] = {40: 1.3, 60: 3.8, 80: 5.9, 100: 10.1, 120: 18.8, 140: 25.6}
"""Published time of collision response against nodes [ms]."""
SHARE, EXPONENT = 0.1, 1.3
"""Largest part of that time for a whole physics step, and largest exponent of cost against nodes."""
_STEPS = 50
"""Number of steps in one timed block."""
Engine = TypeVar("Engine", bound=SingleBackend)
SECONDS, RATE = 7.5, 0.04
"""The shaft is pushed in for so long [s], at that speed [m/s]."""


def answer(effort: Effort) -> Answer:
    """Push scopes of every number of nodes in, then time their steps in turns."""
    place, design = grown(effort), find_design("adult")
    colon = place.colon
    if effort.quick:
        wall = place.wall("prism")
    else:
        effort.tell(f"nodes: a mesh of {TRIANGLES} triangles and its wall")
        colon = with_triangles(colon, TRIANGLES)
        wall = build_wall(colon, method="prism", tolerance=1.5e-3)
    script = steady_push(SECONDS, RATE)
    counts = (40, 80, 140) if effort.quick else tuple(RESPONSE_MS)
    timestep = PRESETS["balanced"].apply().timestep
    options = {count: replace(options_for(colon, design, count), timestep=timestep) for count in counts}
    deepest = script.deepest(SceneOptions.start_depth)
    asked = [(options[count], most) for most in (None, deepest) for count in counts]
    engines = []
    for number, (each, most) in enumerate(asked):
        effort.tell(f"nodes: {counts[number % len(counts)]}{' at most' if most else ''}")
        engines.append(_pushed(build_scene(colon, wall, design, each, show_lumen=False, deepest=most)))
    costs = {"pieces": in_turns([_milliseconds(engine) for engine in engines])}
    effort.tell("nodes: field")
    tables = [(replace(each, wall_law="table", softening=False), most) for each, most in asked]
    scenes = [build_scene(colon, None, design, each, show_lumen=False, deepest=most) for each, most in tables]
    costs["field"] = in_turns([_field_block(scene) for scene in scenes])
    rows: list[dict[str, Value]] = []
    for number, count in enumerate(counts):
        engine, less = engines[number], engines[number + len(counts)]
        seen = engine.read()
        row: dict[str, Value] = {"nodes": count, "dofs": engine.model.nv, "step_ms": costs["pieces"][number]}
        row |= {"field_step_ms": costs["field"][number], "bar_ms": SHARE * RESPONSE_MS[count]}
        row |= {"contacts": seen.contacts, "insertion_m": seen.insertion, "dofs_by_default": less.model.nv}
        row |= {f"{name}_by_default_ms": found[number + len(counts)] for name, found in costs.items()}
        rows.append(row)
    note = (
        f"Nodes: {len(colon.lumen.faces)} triangles, {len(wall.pieces)} pieces of wall, every joint of the scope "
        "modelled, though most are outside, but for what is named 'by default'; processor time on the machine named, "
        f"not the paper's, at the end of a push of {SECONDS:g} s, all in turns, medians; the field on one thread."
    )
    whole = {name: dict(zip(counts, found[: len(counts)], strict=True)) for name, found in costs.items()}
    criteria = [
        criterion for name, found in whole.items() for criterion in _criteria(name, found, len(colon.lumen.faces))
    ]
    return Answer(tables=[Table("A physics step against nodes", tuple(rows))], criteria=criteria, notes=[note])


def _criteria(engine: str, costs: Mapping[int, float], triangles: int) -> list[Criterion]:
    criteria = [
        Criterion(
            f"physics step, {engine}, {count} nodes, {triangles} triangles",
            ms,
            SHARE * RESPONSE_MS[count],
            "ms",
            "at most",
        )
        for count, ms in costs.items()
    ]
    exponent = float(np.polyfit(np.log(list(costs)), np.log(list(costs.values())), 1)[0])
    return [
        *criteria,
        Criterion(f"exponent of cost against nodes up to 140, {engine}", exponent, EXPONENT, "1", "at most"),
    ]


def _field_block(scene: Scene) -> Block:
    """Steps of the scope in linear time from the end of the push on, with a still hand."""
    engine = _pushed(scene, LinearSingle)
    still = Controls(0.0, 0.0)
    return lambda: processor_seconds(lambda: engine.step(still, _STEPS)) / _STEPS * 1e3


def _pushed(scene: Scene, kind: Callable[[Scene], Engine] = NativeEngine) -> Engine:
    engine, inputs = kind(scene), Controls(RATE, 0.0)
    steps = round(CONTROL_INTERVAL / scene.options.timestep)
    for _ in range(round(SECONDS / CONTROL_INTERVAL)):
        engine.step(inputs, steps)
    return engine


def _milliseconds(engine: NativeEngine) -> Block:
    block = stepping(engine.model, engine.data, steps=50)
    return lambda: block() * engine.model.opt.timestep * 1e3
