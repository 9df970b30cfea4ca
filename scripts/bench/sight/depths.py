"""Distances by every renderer, from the same tips in the same colons, against MuJoCo's exact rays to the same wall."""

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.sight import RANGE, HostEyes
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import lens_of, lens_rays
from haustra.envs.view.picture.light import Light
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import ColonSurface, LumenSurface, MovingSurface
from haustra.errors import MissingDependencyError
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.rays import LumenRays
from haustra.models.wall.lumen_table import stack
from haustra.scripts.bench.sight.mitsuba_light import MitsubaScene, has_mitsuba
from haustra.scripts.bench.sight.traced_scene import MM, traced_scene

_KNOWN = 0.95
"""Distances are compared up to this share of the range that depth pictures have [1]."""
FIELD_DEG = 140.0
"""Full angle of depth pictures [degrees]; engineering choice, that of an adult scope's tip."""


class Tip(NamedTuple):
    """A tip in one world, and the wall as exact rays take it."""

    scope: Endoscope
    """Its surface is where the colon is, out of the tip's way."""
    pose: CameraPose
    frame: Float[np.ndarray, "3 3"]
    """Columns: wire 'up', wire 'left', viewing direction."""
    untouched: ColonSurface
    """The surface as it would be without the tip."""


Found = list[Float[np.ndarray, "size size"]]
"""Distances of all tips' pixels [m]; infinite or the range where there is none."""


def bench_depths(
    bank: ColonSet,
    *,
    worlds: int,
    size: int,
    seconds: float,
    motions: Sequence[bool] = (False, True),
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Differences of every renderer that works here, one row each, in colons that stand and in colons that move.

    Args:
        bank: the colons.
        worlds: tips, spread over the colons.
        size: rows and columns of pictures.
        seconds: simulated time for which the follower has driven [s].
        motions: whether colons move, in turn.
        progress: told rows done.
    """
    rows = []
    for moves in motions:
        task = _driven(bank, worlds, size, seconds, moves=moves)
        tips = [_tip(task, world, size) for world in range(worlds)]
        by_gpu = "programs of linear time (GPU)", lambda moves=moves: _by_gpu(bank, worlds, size, seconds, moves=moves)
        for name, made in (*_renderers(task, tips, size, moves=moves), by_gpu):
            try:
                row = {"renderer": name, "colons": "move" if moves else "stand", **made()}
            except MissingDependencyError as error:
                row = {"renderer": name, "colons": "move" if moves else "stand", "missing": str(error)}
            rows.append(row)
            progress(len(rows), name)
        task.close()
    return rows


def _driven(
    bank: ColonSet, worlds: int, size: int, seconds: float, *, moves: bool, backend: str = "linear"
) -> ScopeTask:
    config = TaskConfig(design=bank.design.name, observation="pixels", picture_size=size, mesentery=moves)
    task = ScopeTask(config, worlds=worlds, backend=backend, bank=bank)
    seen = task.reset(seeds=list(range(worlds)), case=np.arange(worlds) % len(bank.cases))
    driver = FollowerDriver(task)
    driver.begin(np.ones(worlds, bool))
    for _ in range(round(seconds / task.interval)):
        seen = task.step(driver.act(seen)).observation
    return task


def _tip(task: ScopeTask, world: int, size: int) -> Tip:
    seen, tabulated = task.seen, task.bank.cases[int(task.case[world])]
    colon, moved = tabulated.colon(), task.displacement
    surfaces: list[ColonSurface] = []
    for _ in range(2):
        if moved is None:
            surfaces.append(ColonSurface(colon))
            continue
        moving = MovingSurface(colon, stack([tabulated.with_mesentery()]), *tabulated.own_axes)
        moving.move(moved[world])
        surfaces.append(moving)
    surface, untouched = surfaces
    place, frame = seen.tip[world], seen.tip_frame[world]
    surface.make_room(place, frame[:, 2], float(seen.tip_arc[world]), task.bank.design.diameter / 2)
    scope = Endoscope(colon, lens_of(task.bank.design.tip, size, size), surface=surface)
    return Tip(scope, CameraPose.of_tip(place, frame), frame, untouched)


def _renderers(
    task: ScopeTask, tips: list[Tip], size: int, *, moves: bool
) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
    """Names, and what measures each."""
    within = [tip.scope.renderer.lens.within for tip in tips]
    by_lens = _exact_by_lens(tips)
    rays, circle = lens_rays(FIELD_DEG, size)
    by_circle = [_exact(tip.untouched, tip.pose, rays @ tip.frame.T) for tip in tips]
    seen, one = task.seen, task.case
    about = {"field_of_view_deg": FIELD_DEG, "size": size}
    at = one, seen.tip, seen.tip_frame, seen.tip_arc

    def lens(found: Found) -> dict[str, Any]:
        return _row(found, by_lens, within)

    def depth(found: np.ndarray) -> dict[str, Any]:
        return _row(list(found), by_circle, [circle] * len(tips))

    yield "exact rays (CPU)", lambda: lens([tip.scope.look(tip.pose).distance for tip in tips])
    yield "OpenGL", lambda: lens(_by_opengl(tips))
    yield "programs of linear time (CPU)", lambda: lens(_by_table(task))
    yield "Mitsuba", lambda: lens(_by_mitsuba(tips, size))
    sight, at_rest = task.sight, HostEyes(task.sight, task.backend).at_rest(one)
    yield "depth pictures, numpy", lambda: depth(sight.depth(*at, **about, at_rest=at_rest))
    yield "depth pictures, JAX", lambda: depth(_by_jax(task, about))
    if not moves:
        yield "depth pictures, MuJoCo Warp", lambda: depth(_by_warp(task, about))


def _exact_by_lens(tips: list[Tip]) -> Found:
    return [_exact(tip.scope.surface, tip.pose, tip.scope.renderer.lens.grid @ tip.pose.rotation.T) for tip in tips]


def _exact(surface: LumenSurface, pose: CameraPose, towards: Float[np.ndarray, "size size 3"]) -> np.ndarray:
    for stretch in range(surface.count):
        surface.bring(stretch)
    rays = LumenRays(Surface(surface.vertices.copy(), surface.faces))
    return rays.cast(pose.position[None], towards.reshape(1, -1, 3))[0].reshape(towards.shape[:2])


def _row(found: Found, exact: Found, within: list[np.ndarray]) -> dict[str, Any]:
    parts, count = [], 0
    for own, known, shown in zip(found, exact, within, strict=True):
        # Where either is beyond the range, only that may be compared, not by how much.
        both = shown & (np.minimum(own, known) < _KNOWN * RANGE)
        parts.append(np.abs(np.minimum(own, RANGE) - np.minimum(known, RANGE))[both])
        count += int(both.sum())
    apart = MM * np.concatenate(parts)
    shares = {f"within_{name}": float((apart <= bound).mean()) for name, bound in (("0.05_mm", 0.05), ("1_mm", 1.0))}
    return {"pixels": count, "median_mm": float(np.median(apart)), "p99_mm": float(np.percentile(apart, 99)), **shares}


def _by_opengl(tips: list[Tip]) -> Found:
    from haustra.envs.view.picture.gl_endoscope import GlEndoscope

    found: Found = []
    for tip in tips:
        surface, looks = tip.scope.surface, tip.scope.appearance
        assert isinstance(surface, ColonSurface)
        drawn = GlEndoscope(surface.colon, tip.scope.renderer.lens, surface=surface, appearance=looks)
        drawn.draw(tip.pose)
        found.append(drawn.distance())
        drawn.device.close()
    return found


def _by_table(task: ScopeTask) -> Found:
    from haustra.envs.sim.linear.backend import LinearBackend
    from haustra.envs.tasks.tip_pictures import TipPictures

    assert isinstance(task.backend, LinearBackend)
    pictures = TipPictures(task.bank, task.backend, task.config.picture_size)
    pictures.draw()
    return list(pictures.distance)


def _by_gpu(bank: ColonSet, worlds: int, size: int, seconds: float, *, moves: bool) -> dict[str, Any]:
    """Worlds of its own, since a GPU steps them."""
    task = _driven(bank, worlds, size, seconds, moves=moves, backend="linear-gpu")
    tips = [_tip(task, world, size) for world in range(worlds)]
    within = [tip.scope.renderer.lens.within for tip in tips]
    row = _row(_by_table(task), _exact_by_lens(tips), within)
    task.close()
    return row


def _by_mitsuba(tips: list[Tip], size: int) -> Found:
    if not has_mitsuba():
        raise MissingDependencyError("Mitsuba is not installed")
    scenes = [traced_scene(tip.scope, tip.pose, Light(), size=1e-3) for tip in tips]
    return [MitsubaScene(scene).rays().distance.reshape(size, size) / MM for scene in scenes]


def _by_jax(task: ScopeTask, about: dict[str, Any]) -> np.ndarray:
    if find_spec("jax") is None:
        raise MissingDependencyError("JAX is not installed")
    from haustra.envs.tasks.device_sight import DeviceEyes

    seen = task.seen
    found = DeviceEyes(task.sight, task.backend).depth(task.case, seen.tip, seen.tip_frame, seen.tip_arc, **about)
    return found * (RANGE / 255)


def _by_warp(task: ScopeTask, about: dict[str, Any]) -> np.ndarray:
    if find_spec("warp") is None:
        raise MissingDependencyError("MuJoCo Warp is not installed")
    from haustra.envs.view.picture.warp_cameras import WarpCameras

    seen, colons = task.seen, [case.colon() for case in task.bank.cases]
    cameras = WarpCameras(colons, worlds=task.worlds, reach=RANGE, device="cpu", **about)
    beyond = task.sight.beyond(task.case, seen.tip, seen.tip_arc)
    return cameras.depth(task.case, seen.tip, seen.tip_frame, beyond) * (RANGE / 255)
