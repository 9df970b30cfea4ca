"""Interactive curves in a page, with the plotting library inside the page."""

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from haustra.envs.view.report.sections import Chart

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

_COLOURS = ("#c2413b", "#2f6f8f", "#3b7d4f", "#8a6d1f", "#6b4a8a")
_PANEL_HEIGHT, _MARGIN = 210, 90  # [pixels]
_MOST_SAMPLES = 3000
"""Longer curves are thinned to this many samples, keeping each stretch's extremes, so that the page stays small."""


def plotly_script() -> str:
    """The plotting library as an inline script; some 4.5 MB."""
    from plotly.offline import get_plotlyjs

    return f"<script>{get_plotlyjs()}</script>\n"


def chart_html(chart: Chart, element: str) -> str:
    """A `div` named `element` and the script that fills it."""
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=len(chart.panels), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    colours = cycle(_COLOURS)  # on from panel to panel: all curves share one legend
    for row, (label, curves) in enumerate(chart.panels.items(), start=1):
        for name, values in curves.items():
            kept = thin(values)
            line = {"color": next(colours), "width": 1.5}
            figure.add_trace(Scatter(x=chart.x[kept], y=values[kept], name=name, line=line), row=row, col=1)
        figure.update_yaxes(title_text=label, row=row, col=1)
    figure.update_xaxes(title_text=chart.x_label, row=len(chart.panels), col=1)
    figure.update_layout(
        template="plotly_white",
        height=_PANEL_HEIGHT * len(chart.panels) + _MARGIN,
        margin={"l": 70, "r": 20, "t": 20, "b": 50},
        hovermode="x unified",
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"},
        font={"family": "inherit", "color": "#30343b"},
    )
    return figure_html(figure, element)


def figure_html(figure: "Figure", element: str) -> str:
    """HTML of a figure that is there already, without Plotly's own script."""
    return figure.to_html(
        full_html=False, include_plotlyjs=False, div_id=element, config={"displaylogo": False, "responsive": True}
    )


def thin(values: np.ndarray) -> np.ndarray:
    """Indices of at most `_MOST_SAMPLES` samples; the extremes of each stretch are among them."""
    if len(values) <= _MOST_SAMPLES:
        return np.arange(len(values))
    stretches = np.array_split(np.arange(len(values)), _MOST_SAMPLES // 2 - 1)
    extremes = [part[[np.argmin(values[part]), np.argmax(values[part])]] for part in stretches]
    return np.unique(np.concatenate([[0], *extremes, [len(values) - 1]]))
