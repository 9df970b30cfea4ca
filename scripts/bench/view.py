"""How many pictures of the lumen a second the tip's camera gives while the scope moves."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import mujoco
import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import driven_scope
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.gl_endoscope import GlEndoscope
from haustra.envs.view.picture.in_sight import LumenInSight
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import MovingSurface
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import build_scene, entry_of
from haustra.models.wall.lumen_table import Tables, lumen_table, stack
from haustra.scripts.bench.cost import options_for

_BEFORE = 200
"""Control intervals of 20 ms before anything is timed: the tip is some 0.2 m in."""
_FRAMES = 50
_LEAST_TIME = 0.5
"""Rates are measured for at least so long [s]."""


class Looked(NamedTuple):
    """A colon that moves, and exact rays into it."""

    colon: Colon
    design: ScopeDesign
    tables: Tables
    surface: MovingSurface
    scope: Endoscope


def looked_into(colon: Colon, design: ScopeDesign, *, width: int, height: int) -> Looked:
    """Hang a colon on its mesentery, and look into it by a scope's lens in pictures of that size [pixels]."""
    table = lumen_table(colon, device_radius=design.diameter / 2, with_mesentery=True)
    tables = stack([table.seen_from(*entry_of(colon))])
    surface = MovingSurface(colon, tables, *entry_of(colon))
    scope = Endoscope(colon, lens_of(design.tip, width, height), surface=surface)
    return Looked(colon, design, tables, surface, scope)


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
            row: dict[str, Any] = {"renderer": "opengl", "joints": count, "triangles": len(colon.lumen.faces)}
            row["frames_per_s"] = _rate(lambda now=moving: now.picture(renderer, steps=1))
            row["frames_per_s_real_time"] = _rate(lambda now=moving: now.picture(renderer, steps=4))
            row["draw_ms"] = 1e3 / _rate(lambda now=moving: now.picture(renderer))
            picture = moving.picture(renderer)
            row["triangles_drawn"] = moving.show()
            row["draw_whole_ms"] = 1e3 / _rate(lambda now=moving: now.picture(renderer, whole=True))
            whole = moving.picture(renderer, whole=True)
        row["unlike_whole"] = float((np.abs(whole.astype(int) - picture).max(axis=2) > 1).mean())
        rows.append({**row, "steps_per_s": _rate(lambda now=moving: now.step(1)), "picture_spread": float(whole.std())})
        progress(len(rows), f"{count} joints")
    return rows


def bench_rays(
    looked: Looked,
    counts: Sequence[int],
    *,
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Frames a second without OpenGL in a colon that moves on its mesentery, each a physics step and a picture.

    Beside them stands the processor time of a picture's parts, which other work on the cores changes less.

    Args:
        looked: the colon.
        counts: numbers of joints.
        progress: told counts done.
    """
    colon, design, tables, surface, scope = looked
    rows = []
    for count in counts:
        moving = _Moving(colon, design, count, mesentery=True, tables=tables)
        for _ in range(_BEFORE):
            moving.step(4)
        pose = moving.bring(surface)
        row: dict[str, Any] = {"renderer": "rays", "joints": count, "triangles": len(colon.lumen.faces)}
        row["frames_per_s"] = _rate(lambda now=moving: scope.picture(now.bring(surface, steps=1)))
        row["frames_per_s_real_time"] = _rate(lambda now=moving: scope.picture(now.bring(surface, steps=4)))
        row["draw_ms"] = 1e3 / _rate(lambda now=moving: scope.picture(now.bring(surface)))
        row["rays_ms"] = 1e3 / _rate(lambda at=pose: scope.look(at))
        row |= _processor_times(scope, lambda now=moving: now.bring(surface))
        row["steps_per_s"] = _rate(lambda now=moving: now.step(1))
        row["colon_moved_mm"] = 1e3 * moving.moved()
        row["picture_spread"] = float(scope.picture(moving.bring(surface)).std())
        rows.append(row)
        progress(len(rows), f"{count} joints")
    return rows


def bench_shader(
    looked: Looked,
    counts: Sequence[int],
    *,
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Frames a second by OpenGL with the mucosa's shader, in a colon that moves on its mesentery.

    The scope is driven within its program, as in `haustra run`: a physics step is a decision and a step of 5 ms.

    A picture is one whose colon, scope and camera are new, back in the host's memory. `frames_per_s` and
    `pictures_per_s` fetch each picture while the next is drawn, `_alone` before anything else is done. Beside rates
    stand the parts of a frame, by the host's clock, in processor time of the thread that asks for them, and by the
    device's own clock, and how the last picture differs from that of exact rays.

    Args:
        looked: the colon.
        counts: numbers of joints.
        progress: told counts done.
    """
    colon, design, tables, surface, scope = looked
    drawn = GlEndoscope(colon, scope.renderer.lens, surface=surface, appearance=scope.appearance)
    rows = []
    for count in counts:
        moving = _Moving(colon, design, count, mesentery=True, tables=tables)
        for _ in range(_BEFORE):
            moving.step(4)
        pose = moving.bring(surface)
        row: dict[str, Any] = {"renderer": "opengl, mucosa's shader", "on": drawn.device.name, "joints": count}
        row["triangles"] = len(colon.lumen.faces)
        for name, steps in (("frames_per_s", 1), ("frames_per_s_real_time", 4), ("pictures_per_s", 0)):
            row[name] = _overlapped(drawn, moving, surface, steps)
        row["frames_per_s_alone"] = _rate(lambda now=moving: drawn.picture(now.bring(surface, steps=1)))
        row["pictures_per_s_alone"] = _rate(lambda now=moving: drawn.picture(now.bring(surface)))
        row["draw_ms"] = 1e3 / _rate(lambda at=pose: drawn.picture(at))
        row["submit_ms"] = 1e3 / _rate(lambda at=pose: drawn.draw(at))
        row["surface_ms"] = 1e3 / _rate(lambda now=moving: now.bring(surface))
        row |= _host_times(drawn, moving, surface)
        row |= _device_times(drawn, pose)
        row["steps_per_s"] = _rate(lambda now=moving: now.step(1))
        row["colon_moved_mm"] = 1e3 * moving.moved()
        pose = moving.bring(surface)
        picture, distance, view = drawn.picture(pose), drawn.distance(), scope.look(pose)
        off = np.abs(scope.develop(scope.radiance(view)).astype(int) - picture).max(axis=2)
        both = (view.own >= 0) & np.isfinite(distance)
        row["unlike_rays"] = float((off > 1).mean())
        row["depth_median_mm"] = float(np.median(1e3 * np.abs(distance[both] - view.distance[both])))
        row["picture_spread"] = float(picture.std())
        rows.append(row)
        progress(len(rows), f"{count} joints")
    drawn.device.close()
    return rows


def _overlapped(drawn: GlEndoscope, moving: "_Moving", surface: MovingSurface, steps: int) -> float:
    """Frames a second, each some physics steps and a picture that is fetched when the next is under way."""
    last = drawn.draw(moving.bring(surface))

    def frame() -> None:
        nonlocal last
        under_way = drawn.draw(moving.bring(surface, steps=steps))
        drawn.fetch(last)
        last = under_way

    return _rate(frame)


def _device_times(drawn: GlEndoscope, pose: CameraPose) -> dict[str, float]:
    """Medians of the times that the parts of a picture take on the device [ms]."""
    found = [drawn.part_times(pose) for _ in range(_FRAMES)]
    return {f"{part}_device_ms": 1e3 * float(np.median([each[part] for each in found])) for part in found[0]}


def _host_times(drawn: GlEndoscope, moving: "_Moving", surface: MovingSurface) -> dict[str, float]:
    """Processor time of the parts of a frame in the thread that asks for them, without waiting for pictures [ms]."""
    spent: dict[str, float] = dict.fromkeys(("step", "surface", "submit", "fetch"), 0.0)

    def part(name: str, act: Callable[[], Any]) -> Any:
        began = time.thread_time()
        found = act()
        spent[name] += time.thread_time() - began
        return found

    for _ in range(_FRAMES):
        part("step", lambda: moving.step(1))
        pose = part("surface", lambda: moving.bring(surface))
        which = part("submit", partial(drawn.draw, pose))
        drawn.fetch(which)
        part("fetch", partial(drawn.fetch, which))
    return {f"{name}_processor_ms": 1e3 * each / _FRAMES for name, each in spent.items()}


def _processor_times(scope: Endoscope, bring: Callable[[], CameraPose]) -> dict[str, float]:
    """Processor time of the parts of a picture, of all cores together [ms]."""

    def each(act: Callable[[], object]) -> float:
        act()
        began = time.process_time()
        for _ in range(_FRAMES):
            act()
        return 1e3 * (time.process_time() - began) / _FRAMES

    pose = bring()
    view = scope.look(pose)
    light = scope.radiance(view)
    rays = each(lambda: scope.look(pose))
    parts = {"surface": each(lambda: scope.look(bring())) - rays, "rays": rays}
    parts |= {"shading": each(lambda: scope.radiance(view)), "exposure": each(lambda: scope.develop(light))}
    return {f"{name}_processor_ms": spent for name, spent in parts.items()}


class _Moving:
    """A scope that the lumen follower drives, and what of the lumen its tip may see."""

    def __init__(
        self, colon: Colon, design: ScopeDesign, joints: int, *, mesentery: bool = False, tables: Tables | None = None
    ) -> None:
        options = replace(options_for(colon, design, joints), wall_law="table", softening=False, timestep=0.005)
        scene = build_scene(colon, None, design, replace(options, mesentery=mesentery))
        if tables is None:
            tables = stack([lumen_table(colon, device_radius=scene.cable.radius).seen_from(*entry_of(colon))])
        self.engine, _ = driven_scope(scene, tables, FollowerSettings(), steps=1)
        self.sight = LumenInSight(self.engine.model)

    def step(self, count: int) -> None:
        """Let the follower decide before each of so many steps."""
        self.engine.many.drive(count)

    def bring(self, surface: MovingSurface, *, steps: int = 0) -> CameraPose:
        """Step, take the surface to where the colon is then, with the scope in it, and return the camera's pose."""
        if steps:
            self.step(steps)
        engine, cable = self.engine, self.engine.scene.cable
        rows = engine.rows()
        seen = engine.readings(rows)
        frame = seen.tip_frame[0]
        surface.move(engine.displacements(rows)[0])
        path = engine.shape()[cable.node_distances < seen.insertion[0]]
        path[-1] -= cable.radius * frame[:, 2]  # the ball about its end is the tip's rim, not before the lens
        surface.indent(path, cable.radius)
        return CameraPose.of_tip(seen.tip[0], frame)

    def moved(self) -> float:
        """Farthest that the colon is from where it was at rest [m]."""
        return float(self.engine.colon_moved(self.engine.rows())[0])

    def show(self) -> int:
        """Show MuJoCo's renderer what the camera may see; how many triangles."""
        self.engine.place()
        return self.sight.show(self.engine.data, float(self.engine.readings(self.engine.rows()).tip_arc[0]))

    def picture(self, renderer: mujoco.Renderer, *, steps: int = 0, whole: bool = False) -> np.ndarray:
        if steps:
            self.step(steps)
        self.show()
        if whole:
            self.sight.show_all()
        renderer.update_scene(self.engine.data, camera="scope/camera")
        return renderer.render()


def _rate(act: Callable[[], object]) -> float:
    """Calls a second, without the first few: of `_FRAMES`, or of as many as half a second takes."""
    for _ in range(10):
        act()
    began, count, spent = time.perf_counter(), 0, 0.0
    while count < _FRAMES or spent < _LEAST_TIME:
        act()
        count, spent = count + 1, time.perf_counter() - began
    return count / spent
