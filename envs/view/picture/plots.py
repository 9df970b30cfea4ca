"""Figures of a run over time, as PNG files."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.files import write_atomically

_COLOURS = ("#c2413b", "#2f6f8f", "#3b7d4f", "#8a6d1f", "#6b4a8a")
_INK, _GRID = "#30343b", "#dfe3e8"
_WIDTH, _PANEL_HEIGHT, _DPI = 9.0, 2.1, 110


def time_figure(
    path: Path,
    time: Float[np.ndarray, " samples"],
    panels: Mapping[str, Mapping[str, Float[np.ndarray, " samples"]]],
) -> Path:
    """Write a figure of curves over time, one panel above the other.

    Args:
        path: PNG file to write.
        time: simulated time [s].
        panels: for each panel its axis label with unit ('force [N]'), and its curves by name.

    Returns:
        `path`.

    Raises:
        OutputError: when the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, 0.5 + _PANEL_HEIGHT * len(panels)), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (label, curves) in zip(axes, panels.items(), strict=True):
        for (name, values), colour in zip(curves.items(), _COLOURS, strict=False):
            axis.plot(time, values, color=colour, linewidth=1.3, label=name)
        _style(axis, label, legend=len(curves) > 1)
    axes[-1].set_xlabel("time [s]", color=_INK)
    axes[-1].set_xlim(time[0], time[-1] if len(time) > 1 else time[0] + 1.0)
    return write_atomically(path, lambda temporary: figure.savefig(temporary, format="png"))


def _style(axis, label: str, *, legend: bool) -> None:
    axis.set_ylabel(label, color=_INK)
    axis.grid(color=_GRID, linewidth=0.8)
    axis.tick_params(colors=_INK, length=0)
    for side in ("top", "right", "left", "bottom"):
        axis.spines[side].set_visible(False)
    if legend:
        axis.legend(frameon=False, ncols=5, loc="lower left", bbox_to_anchor=(0, 1), labelcolor=_INK)
