"""What a run did to the colon, as a PNG file: pain along the colon over time, and the forces that press it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.files import write_atomically
from haustra.models.anatomy.colon import ColonSegment

_INK, _GRID, _MARK, _FORCE = "#30343b", "#dfe3e8", "#c2413b", "#2f6f8f"
_WIDTH, _HEIGHT, _DPI = 9.0, 3.6, 110
_PICTURES = 400
"""Most columns of the map: each shows the worst of the records that it stands for."""


def injury_map(
    path: Path,
    time: Float[np.ndarray, " records"],
    arcs: Float[np.ndarray, " places"],
    pain: Float[np.ndarray, "records places"],
    pressed: Float[np.ndarray, "records places"],
    *,
    segments: Sequence[ColonSegment],
    perforation_arc: float | None,
    p_perforation: float,
) -> Path:
    """Write a map of pain along the colon over time, and beside it the largest force on each place.

    Args:
        path: PNG file to write.
        time: simulated time [s].
        arcs: arc lengths of the places [m].
        pain: at each place [1]; 1 is where it is assumed to begin.
        pressed: largest force on one link there [N].
        segments: of the colon.
        perforation_arc: where the wall is likeliest torn [m]; None when nothing touched it.
        p_perforation: share of people whose wall is [1].

    Returns:
        `path`.

    Raises:
        OutputError: when the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    field, forces = figure.subplots(1, 2, sharey=True, width_ratios=[3, 1])
    columns = np.array_split(np.arange(len(time)), min(_PICTURES, max(len(time), 1)))
    shown = np.array([pain[column].max(axis=0, initial=0.0) for column in columns])
    half = (arcs[1] - arcs[0]) / 2
    extent = (0.0, float(time[-1]) if len(time) else 1.0, float(arcs[0] - half), float(arcs[-1] + half))
    most = max(1.0, float(shown.max(initial=0.0)))
    drawn = field.imshow(shown.T, origin="lower", aspect="auto", extent=extent, cmap="magma_r", vmin=0.0, vmax=most)
    figure.colorbar(drawn, ax=field, label="tension over that which hurts [1]")
    forces.barh(arcs, pressed.max(axis=0, initial=0.0), height=2 * half, color=_FORCE)
    for axis in (field, forces):
        for segment in segments:
            axis.axhline(segment.start, color=_GRID, linewidth=0.8)
        if perforation_arc is not None:
            axis.axhline(perforation_arc, color=_MARK, linewidth=1.2, linestyle="--")
        axis.tick_params(colors=_INK, length=0)
        for side in ("top", "right", "left", "bottom"):
            axis.spines[side].set_visible(False)
    for segment in segments:
        field.text(extent[1] * 0.01, (segment.start + segment.end) / 2, segment.name, color=_INK, va="center")
    field.set(xlabel="time [s]", ylabel="along the colon [m]", ylim=extent[2:])
    forces.set(xlabel="largest force [N]")
    said = f"torn in {100 * p_perforation:.2g} % of people"
    forces.set_title(said, color=_MARK, loc="right", fontsize="medium")
    return write_atomically(path, lambda temporary: figure.savefig(temporary, format="png"))
