"""Question: what does a physics step cost against the number of nodes, in a colon of 623,805 triangles?

Bars: a tenth of the collision-response time that the colonoscopy simulator's authors print for their scene, and an
exponent of 1.3 at most. Every node is modelled, wherever it is; a run that cannot use them all leaves them out. Two
engines: MuJoCo's against the wall's pieces, and the chain in JAX against the tabulated lumen.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from haustra.envs.bench.accuracy.drive import steady_push
from haustra.envs.bench.accuracy.places import grown
from haustra.envs.bench.accuracy.question import Answer, Effort
from haustra.envs.bench.accuracy.refined_mesh import with_triangles
from haustra.envs.bench.accuracy.timing import Block, in_turns, stepping
from haustra.envs.bench.cost import options_for
from haustra.envs.bench.result import Bar, Table, Value
from haustra.envs.engine.native import Inputs, NativeEngine
from haustra.envs.insertion import CONTROL_INTERVAL
from haustra.models.anatomy.colon import Colon
from haustra.models.presets import PRESETS
from haustra.models.scene import build_scene
from haustra.models.scope.design import ScopeDesign
from haustra.models.scope.files import find_design
from haustra.models.wall.build import build_wall
from haustra.models.wall.wall import Wall

TRIANGLES = 623_805
"""Of the published scene."""
RESPONSE_MS: Mapping[int, float] = {40: 1.3, 60: 3.8, 80: 5.9, 100: 10.1, 120: 18.8, 140: 25.6}
"""Published time of collision response against nodes [ms]."""
SHARE, EXPONENT = 0.1, 1.3
"""Largest part of that time for a whole physics step, and largest exponent of cost against nodes."""
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
    engines, blocks = {}, []
    for count in (40, 80, 140) if effort.quick else RESPONSE_MS:
        effort.tell(f"nodes: {count}")
        engine, inputs = _pushed(colon, wall, design, count)
        engine.step(inputs, 1)
        engines[count] = engine
        blocks.append(_milliseconds(engine))
    costs = {"pieces": dict(zip(engines, in_turns(blocks), strict=True)), "field": {}}
    for count in engines:
        effort.tell(f"nodes: {count}, field")
        costs["field"][count] = _field_milliseconds(colon, design, count)
    rows: list[dict[str, Value]] = []
    for count, engine in engines.items():
        seen = engine.observe()
        rows.append(
            {
                "nodes": count,
                "dofs": engine.model.nv,
                "step_ms": costs["pieces"][count],
                "field_step_ms": costs["field"][count],
                "bar_ms": SHARE * RESPONSE_MS[count],
                "contacts": seen.contacts,
                "insertion_m": seen.insertion,
            }
        )
    note = (
        f"Nodes: {len(colon.lumen.faces)} triangles, {len(wall.pieces)} pieces of wall, every joint of the scope "
        "modelled, though most are outside; processor time on the machine named, which is not the paper's. The field's "
        "cost is the mean over the push."
    )
    bars = [bar for name, found in costs.items() for bar in _bars(name, found, len(colon.lumen.faces))]
    return Answer(tables=[Table("A physics step against nodes", tuple(rows))], bars=bars, notes=[note])


def _bars(engine: str, costs: Mapping[int, float], triangles: int) -> list[Bar]:
    bars = [
        Bar(
            f"physics step, {engine}, {count} nodes, {triangles} triangles",
            ms,
            SHARE * RESPONSE_MS[count],
            "ms",
            "at most",
        )
        for count, ms in costs.items()
    ]
    exponent = float(np.polyfit(np.log(list(costs)), np.log(list(costs.values())), 1)[0])
    return [*bars, Bar(f"exponent of cost against nodes up to 140, {engine}", exponent, EXPONENT, "1", "at most")]


def _field_milliseconds(colon: Colon, design: ScopeDesign, count: int) -> float:
    """Mean over a push; infinite where JAX is not installed or the world diverged."""
    try:
        from haustra.envs.bench.accuracy.drive_worlds import replay_in_field
    except ImportError:
        return float("inf")
    options = replace(options_for(colon, design, count), timestep=PRESETS["balanced"].apply().timestep)
    script = steady_push(SECONDS, RATE)
    track = replay_in_field(script, colon, design, options)
    return track.cost * options.timestep * 1e3 if len(track) == len(script) else float("inf")


def _pushed(colon: Colon, wall: Wall, design: ScopeDesign, count: int) -> tuple[NativeEngine, Inputs]:
    options = replace(options_for(colon, design, count), timestep=PRESETS["balanced"].apply().timestep)
    engine = NativeEngine(build_scene(colon, wall, design, options, show_lumen=False))
    inputs = Inputs(RATE, 0.0)
    for _ in range(round(SECONDS / CONTROL_INTERVAL)):
        engine.step(inputs, round(CONTROL_INTERVAL / options.timestep))
    return engine, inputs


def _milliseconds(engine: NativeEngine) -> Block:
    block = stepping(engine.model, engine.data, steps=50)
    return lambda: block() * engine.model.opt.timestep * 1e3
