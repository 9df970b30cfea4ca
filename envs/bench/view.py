"""How many pictures of the lumen a second the tip's camera gives while the scope moves."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from haustra.envs.bench.cost import options_for
from haustra.envs.engine.field_engine import FieldEngine
from haustra.envs.engine.native import Inputs
from haustra.envs.picture.camera import looking
from haustra.envs.picture.tip import tip_view
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import build_scene
from haustra.models.scope.design import ScopeDesign

RATE = 0.04
"""The scope is pushed in at this speed [m/s]."""
_BEFORE = 200
"""Control intervals of 20 ms before anything is timed: the tip is 0.19 m in."""
_FRAMES = 100


def bench_view(
    colon: Colon,
    design: ScopeDesign,
    counts: Sequence[int],
    *,
    width: int,
    height: int,
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Frames a second, each a physics step and a picture, and each four steps (real time at 50 Hz) and a picture.

    Args:
        colon: the colon; its whole surface is drawn.
        design: the scope.
        counts: numbers of joints.
        width: columns of a picture.
        height: rows of a picture.
        progress: told counts done.
    """
    rows = []
    for count in counts:
        options = replace(options_for(colon, design, count), wall_law="field", timestep=0.005)
        engine = FieldEngine(build_scene(colon, None, design, options))
        for _ in range(_BEFORE):
            engine.step(Inputs(RATE, 0.0), 4)
        model = engine.model
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        with mujoco.Renderer(model, height, width) as renderer:
            row = {"joints": count, "triangles": len(colon.lumen.faces), "frames_per_s": _rate(engine, renderer, 1)}
            row["frames_per_s_real_time"] = _rate(engine, renderer, 4)
            row["draw_ms"] = 1e3 / _rate(engine, renderer, 0)
            picture = renderer.render()
        rows.append({**row, "steps_per_s": _steps(engine), "picture_spread": float(np.std(picture))})
        progress(len(rows), f"{count} joints")
    return rows


def software_rate(colon: Colon, *, size: int = 480) -> float:
    """Pictures a second of the renderer that needs no OpenGL, from 0.2 m into the colon."""
    line = colon.centreline
    here = int(np.searchsorted(line.arc, 0.2))
    rotation = looking(line.frames[here][:, 2], line.frames[here][:, 0])
    began = time.perf_counter()
    tip_view(colon.lumen, line.points[here], rotation, size=size)
    return 1 / (time.perf_counter() - began)


def _rate(engine: FieldEngine, renderer: mujoco.Renderer, steps: int) -> float:
    spent = 0.0
    for frame in range(_FRAMES + 10):
        began = time.perf_counter()
        if steps:
            engine.step(Inputs(RATE, 0.0), steps)
        mujoco.mj_camlight(engine.model, engine.data)
        renderer.update_scene(engine.data, camera="scope/camera")
        renderer.render()
        if frame >= 10:
            spent += time.perf_counter() - began
    return _FRAMES / spent


def _steps(engine: FieldEngine) -> float:
    began = time.perf_counter()
    for _ in range(_FRAMES):
        engine.step(Inputs(RATE, 0.0), 1)
    return _FRAMES / (time.perf_counter() - began)
