"""Benchmarks on one page: criteria, fronts of error against cost, tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from haustra.envs.view.report import sections as page
from haustra.envs.view.report.page import write_report
from haustra.envs.view.report.values import shown
from haustra.scripts.bench.result import Bench, Criterion, ParetoFront, Table, Value

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


def report_bench(folder: Path, benches: Sequence[Bench]) -> Path:
    """Write `report.html` into a folder.

    Raises:
        OutputError: when the file cannot be written.
    """
    criteria = [criterion for bench in benches for criterion in bench.criteria]
    found: list[page.Section] = [
        page.Highlights({"criteria met": f"{sum(criterion.met for criterion in criteria)} of {len(criteria)}"}),
        page.Warnings([f"Not met: {said(criterion)}" for criterion in criteria if not criterion.met]),
    ]
    for bench in benches:
        found.append(page.Text(bench.title, bench.summary))
        if bench.criteria:
            found.append(_criteria(bench.criteria))
        found += [page.Plot(front.question, _figure(front), _note(front)) for front in bench.fronts]
        found += [rows_table(table) for table in bench.tables if table.rows]
        if bench.machine:
            found.append(page.Table("Where it was measured", ("what", "value"), _pairs(bench.machine)))
    return write_report(
        folder, title="Benchmarks", subtitle=", ".join(bench.title for bench in benches), sections=found
    )


def said(criterion: Criterion) -> str:
    """A criterion in one line, without its verdict."""
    measured, bound = measured_and_bound(criterion)
    return f"{criterion.what}: {measured}, {bound}"


def measured_and_bound(criterion: Criterion) -> tuple[str, str]:
    """Both with their unit."""
    unit = "" if criterion.unit == "1" else f" {criterion.unit}"
    measured = f"{criterion.measured:.3g}{unit}" if np.isfinite(criterion.measured) else f"nothing finite{unit}"
    return measured, f"{criterion.sense} {criterion.bound:g}{unit}"


def rows_table(table: Table) -> page.Table:
    """A table of a benchmark, its header the names that its rows have."""
    header = list(dict.fromkeys(name for row in table.rows for name in row))
    rows = [[shown(row.get(name)) for name in header] for row in table.rows]
    return page.Table(table.title, [name.replace("_", " ") for name in header], rows, table.note)


def _criteria(criteria: Sequence[Criterion]) -> page.Table:
    rows = [(criterion.what, *measured_and_bound(criterion), criterion.verdict) for criterion in criteria]
    return page.Table("Bars", ("what", "measured", "criterion", "verdict"), rows)


def _pairs(values: Mapping[str, Value]) -> list[tuple[str, str]]:
    return [(name, shown(value)) for name, value in values.items()]


def _note(front: ParetoFront) -> str:
    lost = [f"{point.setting} ({point.outcome})" for point in front.points if point.outcome != "completed"]
    return f"Against {front.reference}." + (f" Not drawn: {', '.join(lost)}." if lost else "")


def _figure(front: ParetoFront) -> "Figure":
    from plotly.graph_objects import Figure, Scatter

    figure = Figure()
    drawn = [point for point in front.points if point.outcome == "completed" and point.error > 0 and point.cost > 0]
    for group in dict.fromkeys(point.group for point in drawn):
        members = [point for point in drawn if point.group == group]
        figure.add_trace(
            Scatter(
                x=[point.cost for point in members],
                y=[point.error for point in members],
                text=[point.setting for point in members],
                name=group or "other",
                mode="markers",
                marker={"size": 9},
                hovertemplate="%{text}<br>cost %{x:.3g}, error %{y:.3g}<extra></extra>",
            )
        )
    best = [point for point in front.best() if point.error > 0]
    line = {"color": "#30343b", "width": 1, "shape": "hv"}
    figure.add_trace(
        Scatter(x=[each.cost for each in best], y=[each.error for each in best], name="front", mode="lines", line=line)
    )
    figure.update_xaxes(type="log", title_text=f"cost [{front.cost_unit}]")
    figure.update_yaxes(type="log", title_text=f"error [{front.error_unit}]")
    figure.update_layout(template="plotly_white", height=420, margin={"l": 70, "r": 20, "t": 20, "b": 50})
    return figure
