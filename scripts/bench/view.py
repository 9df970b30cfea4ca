"""How many pictures of the lumen a second the tip's camera gives while the scope moves."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from haustra.envs.control.follower import FollowerSettings, LumenFollower
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.in_sight import LumenInSight
from haustra.envs.view.picture.tip import tip_view
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import build_scene
from haustra.scripts.bench.cost import options_for

_BEFORE = 200
"""Control intervals of 20 ms before anything is timed: the tip is some 0.2 m in."""
_FRAMES = 50


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

    What is out of sight is not drawn; beside it stand the time that the whole surface takes to draw, and the share of
    the picture that then differs by more than a grey level.

    Args:
        colon: the colon.
        design: the scope.
        counts: numbers of joints.
        width: columns of a picture.
        height: rows of a picture.
        progress: told counts done.
    """
    rows = []
    for count in counts:
        moving = _Moving(colon, design, count)
        for _ in range(_BEFORE):
            moving.step(4)
        model = moving.engine.model
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        with mujoco.Renderer(model, height, width) as renderer:
            row: dict[str, Any] = {"joints": count, "triangles": len(colon.lumen.faces)}
            row["frames_per_s"] = _rate(lambda now=moving: now.picture(renderer, steps=1))
            row["frames_per_s_real_time"] = _rate(lambda now=moving: now.picture(renderer, steps=4))
            row["draw_ms"] = 1e3 / _rate(lambda now=moving: now.picture(renderer))
            picture = moving.picture(renderer)
            row["triangles_drawn"] = moving.sight.show(moving.engine.data, moving.arc)
            row["draw_whole_ms"] = 1e3 / _rate(lambda now=moving: now.picture(renderer, whole=True))
            whole = moving.picture(renderer, whole=True)
        row["unlike_whole"] = float((np.abs(whole.astype(int) - picture).max(axis=2) > 1).mean())
        rows.append({**row, "steps_per_s": _rate(lambda now=moving: now.step(1)), "picture_spread": float(whole.std())})
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


class _Moving:
    """A scope that the lumen follower drives, and what of the lumen its tip may see."""

    def __init__(self, colon: Colon, design: ScopeDesign, joints: int) -> None:
        options = replace(options_for(colon, design, joints), wall_law="table", softening=False, timestep=0.005)
        self.engine = LinearSingle(build_scene(colon, None, design, options))
        self.sight = LumenInSight(self.engine.model)
        self._tracker = ArcTracker(colon.centreline, start=options.start_depth)
        self._follower = LumenFollower(
            colon.centreline, design, tip_links=self.engine.scene.cable.tip_links, settings=FollowerSettings()
        )

    @property
    def arc(self) -> float:
        return self._tracker.arc

    def step(self, count: int) -> None:
        seen = self.engine.read()
        self._tracker.update(seen.tip)
        interval = count * self.engine.scene.options.timestep
        self.engine.step(self._follower.act(seen, self.arc, interval), count)

    def picture(self, renderer: mujoco.Renderer, *, steps: int = 0, whole: bool = False) -> np.ndarray:
        if steps:
            self.step(steps)
        self.sight.show(self.engine.data, self.arc)
        if whole:
            self.sight.show_all()
        renderer.update_scene(self.engine.data, camera="scope/camera")
        return renderer.render()


def _rate(act: Callable[[], object]) -> float:
    """Calls a second, without the first few."""
    for _ in range(10):
        act()
    began = time.perf_counter()
    for _ in range(_FRAMES):
        act()
    return _FRAMES / (time.perf_counter() - began)
