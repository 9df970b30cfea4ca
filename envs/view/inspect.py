"""A withdrawal as its camera sees it: what was inspected, and what was not, as numbers and as a map of the colon."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool

from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.inspection import CELL, Inspection, in_view
from haustra.envs.view.dataset.moments import Moments
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.renderer import RayRenderer, SurfaceView
from haustra.files import write_atomically
from haustra.models.scene import Scene

LENS, WIDTH, HEIGHT = "cf-hq190l", 300, 240
"""Lens and size of the pictures that are looked at: at 60 mm a pixel is half a millimetre, a triangle two to five."""
INSPECTION, WITHDRAWAL = "inspection.png", "withdrawal.npz"
EVERY = 0.5
"""Time from one look to the next [s]: what counts as seen was in view at two in a row at least."""
_SEEN, _MISSED, _INK, _GRID = "#1f8a4c", "#c2413b", "#30343b", "#c9ced6"


def write_inspection(folder: Path, scene: Scene, withdrawal: Insertion) -> dict[str, Any]:
    """Inspect a withdrawal, write its map and what was recorded of it, and return its scores as plain JSON values.

    Files: inspection.png, withdrawal.npz (the arrays of trajectory.npz).

    Raises:
        OutputError: when they cannot be written.
    """
    recorded = withdrawal.trajectory
    found = inspect(Moments(scene, recorded))
    inspection_map(folder / INSPECTION, found)
    arrays = {**asdict(recorded), "displacement": recorded.displacement.astype(np.float32)}
    write_atomically(folder / WITHDRAWAL, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    last = float(recorded.tip_arc[-1]) if len(recorded.time) else None
    forces = recorded.push_force if len(recorded.time) else np.zeros(1)
    return {
        "withdrawal_outcome": withdrawal.outcome.value,
        "withdrawal_tip_arc_m": last,
        "pull_force_peak_N": float(np.maximum(-forces, 0.0).max()),
        **found.scores(),
    }


def inspect(
    moments: Moments, *, every: float = EVERY, progress: Callable[[float], None] = lambda share: None
) -> Inspection:
    """Look from a scope's camera at the records of a run.

    Args:
        moments: of the run.
        every: time from one look to the next [s].
        progress: told now and then which share is done.
    """
    lens = named_lens(LENS).at(WIDTH, HEIGHT)
    found = Inspection(moments.colon, moments.arcs)
    renderer, time = RayRenderer(moments.colon.lumen, lens), moments.trajectory.time
    if len(time) < 2:
        return found
    records = range(0, len(time), max(1, round(every / float(time[1] - time[0]))))
    before: SurfaceView | None = None
    for count, record in enumerate(records):
        renderer.place(moments.vertices(record))
        view = renderer.look(moments.camera(record))
        if before is not None:
            interval = float(time[record] - time[records[count - 1]])
            found.look(visible_triangles(view, before, interval), interval)
        before = view
        progress((count + 1) / len(records))
    return found


def visible_triangles(view: SurfaceView, before: SurfaceView, interval: float) -> Bool[np.ndarray, " triangles"]:
    """Triangles of which a picture shows some place that can be inspected.

    Args:
        view: what the picture's rays meet.
        before: that of the picture before.
        interval: between them [s].
    """
    hit = view.triangle >= 0
    now = view.lens.grid * np.where(hit, view.distance, np.nan)[..., None]
    then = (view.interpolate(before.vertices) - before.pose.position) @ before.pose.rotation
    passed = now - then
    passed -= (passed * view.lens.grid).sum(-1, keepdims=True) * view.lens.grid
    speed = np.where(hit, np.linalg.norm(passed, axis=-1) / interval, np.inf)
    facing = np.abs((view.normals * view.lens.grid).sum(-1))
    seen = in_view(np.asarray(view.distance, float), facing.astype(float), speed)
    visible = np.zeros(len(view.faces), bool)
    visible[view.triangle[seen]] = True
    return visible


def inspection_map(path: Path, found: Inspection) -> Path:
    """Draw what was seen on the colon unrolled: along it from anus to caecum, and around it.

    Raises:
        OutputError: when the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure

    colon, shown = found.colon, found.unrolled()
    figure = Figure(figsize=(9.0, 3.2), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    shades = LinearSegmentedColormap.from_list("seen", ["#5b2333", "#f4c9b8"])
    extent = (0.0, CELL * len(shown), 0.0, 360.0)
    drawn = axis.imshow(shown.T, origin="lower", aspect="auto", extent=extent, cmap=shades, vmin=0.0, vmax=1.0)
    figure.colorbar(drawn, ax=axis, label="mucosa seen [1]")
    for segment in colon.segments:
        axis.axvline(segment.start, color=_GRID, linewidth=0.8)
        axis.text((segment.start + segment.end) / 2, 372, segment.name, color=_INK, ha="center", fontsize="small")
    for polyp in found.polyps:
        lesion = colon.lesions[polyp.lesion]
        colour, word = (_SEEN, "seen") if polyp.seen else (_MISSED, "missed")
        place = lesion.arc, np.degrees(lesion.angle or 0.0) % 360
        axis.plot(*place, "o", markersize=9, markerfacecolor="none", markeredgecolor=colour, markeredgewidth=2)
        axis.annotate(f"{lesion.size * 1e3:.0f} mm, {word}", place, (6, 6), textcoords="offset points", color=colour)
    axis.set(xlabel="along the colon, from the anus [m]", ylabel="around it [degrees]", ylim=(0, 360))
    axis.tick_params(colors=_INK, length=0)
    for side in axis.spines.values():
        side.set_visible(False)
    return write_atomically(path, lambda temporary: figure.savefig(temporary, format="png"))
