"""Figures of a sweep's report."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.study.ranking import Comparison, DesignTable, Effect, Interval
from haustra.envs.view.report.sections import Plot

if TYPE_CHECKING:
    import polars

ACCENT, QUIET = "#c2413b", "#9aa7b5"
_COLOURS = ("#c2413b", "#2f6f8f", "#3b7d4f", "#8a6d1f", "#6b4a8a", "#56606b")
_LAYOUT = {
    "template": "plotly_white",
    "margin": {"l": 70, "r": 20, "t": 40, "b": 55},
    "font": {"family": "inherit", "color": "#30343b"},
}


def pareto_plot(
    table: DesignTable, places: Int[np.ndarray, " ranked"], front: Bool[np.ndarray, " ranked"], label: Mapping[str, str]
) -> Plot:
    """The first two objectives against each other; the front in colour."""
    from plotly.graph_objects import Figure, Scatter

    first, second = (objective.score for objective in table.study.objectives[:2])
    x, y = table.means(first)[places], table.means(second)[places]
    texts = [table.names[place] for place in places]
    figure = Figure()
    for name, chosen, colour, size in (("others", ~front, QUIET, 6), ("Pareto front", front, ACCENT, 9)):
        picked = np.flatnonzero(chosen)
        figure.add_trace(
            Scatter(
                x=x[picked],
                y=y[picked],
                mode="markers",
                name=name,
                marker={"color": colour, "size": size},
                text=[texts[index] for index in picked],
            )
        )
    figure.update_layout(
        **_LAYOUT,
        height=460,
        xaxis_title=label[first],
        yaxis_title=label[second],
        legend={"orientation": "h", "y": 1.08},
    )
    count = len(table.study.objectives)
    note = "" if count == 2 else f"The front is that of all {count} objectives, so it need not be an edge here."
    return Plot("Pareto front", figure, note)


def parallel_plot(table: DesignTable, places: Int[np.ndarray, " ranked"], label: Mapping[str, str]) -> Plot:
    """Variables and objectives of every complete design, a line each."""
    from plotly.graph_objects import Figure, Parcoords

    axes = {name: values[places] for name, values in table.variables.items()}
    axes |= {objective.score: table.means(objective.score)[places] for objective in table.study.objectives}
    colour = axes[table.study.objectives[0].score]
    figure = Figure(
        Parcoords(
            dimensions=[{"label": label[name], "values": values} for name, values in axes.items()],
            line={
                "color": colour,
                "colorscale": [[0, "#2f6f8f"], [0.5, "#d8d2c4"], [1, "#c2413b"]],
                "showscale": False,
            },
        )
    )
    figure.update_layout(**{**_LAYOUT, "margin": {"l": 80, "r": 60, "t": 70, "b": 30}}, height=430)
    first = label[table.study.objectives[0].score]
    return Plot("Parallel coordinates", figure, f"Coloured by {first}, blue low. Drag along an axis to pick designs.")


def effects_plot(effects: Mapping[str, Sequence[Effect]], label: Mapping[str, str]) -> Plot:
    """A row for each score, a column for each factor."""
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    rows, columns = len(effects), max(map(len, effects.values()))
    figure = make_subplots(rows=rows, cols=columns, shared_yaxes=True, vertical_spacing=0.1, horizontal_spacing=0.03)
    for row, (score, found) in enumerate(effects.items(), start=1):
        for column, effect in enumerate(found, start=1):
            y, low, high = _bars(effect.means)
            figure.add_trace(
                Scatter(
                    x=effect.levels,
                    y=y,
                    mode="lines+markers",
                    error_y={"type": "data", "symmetric": False, "array": high, "arrayminus": low, "thickness": 1},
                    marker={"color": ACCENT, "size": 6},
                    line={"color": ACCENT, "width": 1.5},
                    showlegend=False,
                ),
                row=row,
                col=column,
            )
            if row == rows:
                figure.update_xaxes(title_text=label[effect.factor], row=row, col=column)
        figure.update_yaxes(title_text=label[score], row=row, col=1)
    figure.update_layout(**_LAYOUT, height=230 * rows + 80)
    note = "Means over everything else; bars are 95 % confidence of the mean."
    return Plot("Main effects", figure, note)


def curves_plot(title: str, curves: Mapping[str, Mapping[str, Sequence[float]]], note: str) -> Plot:
    """Curves of several designs over the first of their columns, a panel for each further column."""
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    over, *panels = next(iter(curves.values()))
    figure = make_subplots(rows=len(panels), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for number, (name, columns) in enumerate(curves.items()):
        for row, panel in enumerate(panels, start=1):
            line = {"color": _COLOURS[number % len(_COLOURS)], "width": 1.5}
            trace = Scatter(
                x=columns[over], y=columns[panel], name=name, legendgroup=name, showlegend=row == 1, line=line
            )
            figure.add_trace(trace, row=row, col=1)
    for row, panel in enumerate(panels, start=1):
        figure.update_yaxes(title_text=_axis(panel), row=row, col=1)
    figure.update_xaxes(title_text=_axis(over), row=len(panels), col=1)
    figure.update_layout(
        **_LAYOUT, height=200 * len(panels) + 160, legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"}
    )
    return Plot(title, figure, note)


def condition_plot(
    frame: "polars.DataFrame", designs: Mapping[str, int], condition: str, score: str, label: Mapping[str, str]
) -> Plot:
    """A score of several designs over one condition, mean over the others."""
    from plotly.graph_objects import Figure, Scatter

    figure = Figure()
    for number, (name, design) in enumerate(designs.items()):
        chosen = frame.filter(frame["design"] == design).select(condition, score)
        means = chosen.group_by(condition).mean().sort(condition)
        line = {"color": _COLOURS[number % len(_COLOURS)]}
        figure.add_trace(
            Scatter(
                x=means[condition].to_numpy(), y=means[score].to_numpy(), name=name, mode="lines+markers", line=line
            )
        )
    figure.update_layout(
        **_LAYOUT,
        height=380,
        xaxis_title=label[condition],
        yaxis_title=label[score],
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"},
    )
    return Plot(f"{label[score]} over {label[condition]}", figure, "Mean over the other conditions.")


def comparison_plot(comparisons: Sequence[Comparison], names: Sequence[str], label: Mapping[str, str]) -> Plot:
    """Designs side by side, a panel for each score."""
    from plotly.graph_objects import Scatter
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=1, cols=len(comparisons), horizontal_spacing=0.08)
    for column, comparison in enumerate(comparisons, start=1):
        y, low, high = _bars(comparison.each)
        bars = {"type": "data", "symmetric": False, "array": high, "arrayminus": low}
        marker = {"color": _COLOURS[: len(names)], "size": 10}
        trace = Scatter(x=list(names), y=y, error_y=bars, mode="markers", marker=marker, showlegend=False)
        figure.add_trace(trace, row=1, col=column)
        figure.update_yaxes(title_text=label[comparison.score], row=1, col=column)
    figure.update_layout(**_LAYOUT, height=360)
    return Plot("Side by side", figure, "Means over the conditions that all of them finished, with 95 % confidence.")


def _bars(
    intervals: Sequence[Interval],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Means, and how far below and above them the bounds lie."""
    means = np.array([each.mean for each in intervals])
    low = np.array([each.mean if each.low is None else each.low for each in intervals])
    high = np.array([each.mean if each.high is None else each.high for each in intervals])
    return means, means - low, high - means


def _axis(column: str) -> str:
    from haustra.envs.view.report.values import name_and_unit

    name, unit = name_and_unit(column)
    return f"{name} [{unit}]" if unit else name
