"""The report of a sweep, from what its folder holds."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Int

from haustra.envs.study.export import columns_of, require_polars, results_frame
from haustra.envs.study.questions import find_question
from haustra.envs.study.ranking import (
    Comparison,
    DesignTable,
    Interval,
    Ranking,
    compare,
    design_table,
    effects_of,
    errors_of,
    interval,
    ranked,
)
from haustra.envs.study.sampling import conditions_of
from haustra.envs.study.sensitivity import sobol_indices
from haustra.envs.study.store import SweepStore, read_store
from haustra.envs.study.study import Column, ScoreError, Study, with_unit
from haustra.envs.view.report.page import write_report
from haustra.envs.view.report.sections import Highlights, Section, Table, Warnings
from haustra.envs.view.report.sweep_plots import (
    comparison_plot,
    condition_plot,
    curves_plot,
    effects_plot,
    parallel_plot,
    pareto_plot,
)
from haustra.envs.view.report.values import provenance_table, shown
from haustra.errors import InvalidOptionError

if TYPE_CHECKING:
    import polars

_RANKED, _CURVES, _REASONS, _COMPARED = 25, 4, 20, 3
"""Designs in the table, designs in curves, reasons of failures, and designs compared when none are named."""
_FEW = 6
"""Sets of conditions below which a bootstrap's intervals are known to be too narrow."""
_MOST_LINES = 3000
"""Designs drawn in parallel coordinates and the Pareto plot at most: the best."""


@dataclass(frozen=True)
class _Sweep:
    """What the sections are made of."""

    store: SweepStore
    study: Study
    frame: "polars.DataFrame"
    table: DesignTable
    label: Mapping[str, str]
    """Column to its name with unit."""


def report_sweep(folder: Path, *, designs: Sequence[str] = ()) -> tuple[Path, list[dict]]:
    """Write `report.html` into a sweep's folder; jobs that are not done are left out and counted.

    Args:
        folder: Of a sweep, an optimisation or a sensitivity study.
        designs: Names or numbers of two or more designs to compare; the best three when there are none.

    Returns:
        The report's path, and the comparison: a row for each score and design.

    Raises:
        UnreadableFileError: when the folder holds no sweep.
        InvalidOptionError: when a design to compare is not there.
        MissingDependencyError: without polars.
        OutputError: when the report cannot be written.
    """
    require_polars()
    with read_store(folder) as store:
        sweep = _read(store)
        found = ranked(sweep.table)
        places, front = found.places, found.front
        chosen = _chosen(sweep.table, designs) if designs else [int(place) for place in places[:_COMPARED]]
        comparisons = compare(sweep.table, chosen, _score_names(sweep.study)) if len(chosen) > 1 else []
        sections: list[Section] = [_highlights(sweep, places), _warnings(sweep), _ranking(sweep, found)]
        if len(places) > 1 and sweep.study.objectives:
            sections += _plots(sweep, places, front)
        sections += _comparison(sweep, chosen, comparisons)
        sections += _indices(sweep)
        sections += _failures(sweep)
        sections += [_dictionary(sweep.study), _provenance(store)]
        path = write_report(folder, title=sweep.study.title, subtitle=_subtitle(sweep), sections=sections)
    return path, _rows(sweep.table, chosen, comparisons)


def _read(store: SweepStore) -> _Sweep:
    study, frame = store.study, results_frame(store)
    errors = errors_of(study, store.sessions())
    table = design_table(frame, study, _score_names(study), errors=errors)
    label = {column.name: _label(column) for column in columns_of(study)}
    return _Sweep(store, study, frame, table, label)


def _label(column: Column) -> str:
    name = column.name.replace("_", " ")
    if column.unit in ("1", "text"):
        return name
    return f"{name.removesuffix(' ' + with_unit('', column.unit).strip('_').replace('_', ' '))} [{column.unit}]"


def _score_names(study: Study) -> list[str]:
    """Columns of numbers, the objectives first."""
    wanted = [score.name for score in find_question(study.question).scores if score.unit != "text"]
    wanted = [name for name in wanted if not study.scores or name in study.scores]
    first = [objective.score for objective in study.objectives]
    return [*first, *(name for name in wanted if name not in first)]


def _chosen(table: DesignTable, designs: Sequence[str]) -> list[int]:
    numbers = {str(number): place for place, number in enumerate(table.designs)}
    known = numbers | {name: place for place, name in enumerate(table.names)}
    for design in designs:
        if design not in known:
            raise InvalidOptionError(
                f"Design '{design}' is not in this sweep: give numbers 0 to {len(numbers) - 1} or names."
            )
    if len(designs) < 2:
        raise InvalidOptionError("A comparison needs two designs or more.")
    return [known[design] for design in designs]


def _subtitle(sweep: _Sweep) -> str:
    words = [variable.name.replace("_", " ") for variable in sweep.study.variables]
    return f"{sweep.study.question} of '{sweep.study.base}' · {' × '.join(words)}"


def _highlights(sweep: _Sweep, places: Int[np.ndarray, " ranked"]) -> Highlights:
    counts = sweep.store.counts()
    values = {
        "Jobs finished": f"{counts['finished']} of {sum(counts.values())}",
        "Designs": str(len(sweep.table.designs)),
        "Conditions": str(len(conditions_of(sweep.study))),
    }
    for objective in sweep.study.objectives if len(places) else ():
        means = sweep.table.means(objective.score)[places]
        best = means.max() if objective.goal == "maximise" else means.min()
        end = "largest" if objective.goal == "maximise" else "smallest"
        values[f"{end} {sweep.label[objective.score]}"] = shown(float(best))
    return Highlights(values)


def _warnings(sweep: _Sweep) -> Warnings:
    counts, messages = sweep.store.counts(), []
    if waiting := counts["pending"] + counts["claimed"]:
        messages.append(f"{waiting} jobs are not done: go on with --resume, then write this report again.")
    if wrong := counts["failed"] + counts["diverged"]:
        messages.append(
            f"{wrong} jobs failed or diverged: a design with such a job is not ranked. They are listed below."
        )
    if len(conditions_of(sweep.study)) == 1:
        messages.append("There is one set of conditions only, so nothing can be said about uncertainty.")
    elif len(conditions_of(sweep.study)) < _FEW:
        messages.append("There are few sets of conditions: intervals over them are narrower than they should be.")
    return Warnings(messages)


def _ranking(sweep: _Sweep, found: Ranking) -> Table:
    study, table = sweep.study, sweep.table
    scores = [objective.score for objective in study.objectives]
    header = (
        "rank",
        "design",
        *(sweep.label[v.column] for v in study.variables),
        *(sweep.label[s] for s in scores),
        "",
    )
    rows = []
    shared = Counter(found.ranks.tolist())
    for rank, place, front in zip(found.ranks[:_RANKED], found.places, found.front, strict=False):
        values = [shown(float(table.variables[v.column][place])) for v in study.variables]
        means = [_with_error(interval(table.scores[score][place]), table.errors.get(score)) for score in scores]
        same = " =" if shared[int(rank)] > 1 else ""
        rows.append((f"{rank}{same}", table.names[place], *values, *means, "Pareto" if front else ""))
    unknown = [sweep.label[score] for score in scores if score not in table.errors]
    note = (
        "Means over the conditions, in brackets with 95 % confidence by bootstrap, after ± with their numerical error. "
        "First the Pareto front, then the others, each by mean rank over the objectives. Designs that share a rank (=) "
        "are not told apart: in every objective they differ by less than numerics or conditions make uncertain. "
        + (f"Nobody measured the numerical error of {', '.join(unknown)}. " if unknown else "")
        + f"{len(found.places)} designs finished under all conditions."
    )
    return Table("Ranked designs", header, rows, note)


def _plots(sweep: _Sweep, places: Int[np.ndarray, " ranked"], front: Bool[np.ndarray, " ranked"]) -> list[Section]:
    table, study, label = sweep.table, sweep.study, sweep.label
    drawn = places[:_MOST_LINES]
    sections: list[Section] = []
    if len(study.objectives) > 1:
        sections.append(pareto_plot(table, drawn, front[:_MOST_LINES], label))
    if study.variables:
        sections.append(parallel_plot(table, drawn, label))
    effects = effects_of(sweep.frame, study, _numeric_conditions(sweep))
    if any(effects.values()):
        sections.append(effects_plot(effects, label))
    best = {table.names[place]: int(table.designs[place]) for place in places[:_CURVES]}
    for column in _numeric_conditions(sweep):
        sections.append(condition_plot(sweep.frame, best, column, next(iter(study.objectives)).score, label))
    return sections + _curves(sweep, best)


def _numeric_conditions(sweep: _Sweep) -> list[str]:
    found = find_question(sweep.study.question).conditions
    return [c.name for name, c in found.items() if c.unit != "text" and len(sweep.study.conditions[name]) > 1]


def _curves(sweep: _Sweep, designs: Mapping[str, int]) -> list[Section]:
    """Sections with the curves of the best designs, under the set of conditions in the middle."""
    conditions = conditions_of(sweep.study)
    middle = len(conditions) // 2
    wanted = {number * len(conditions) + middle: name for name, number in designs.items()}
    found = {wanted[row["id"]]: row["curves"] for row in sweep.store.rows() if row["id"] in wanted and row["curves"]}
    if not found:
        return []
    under = ", ".join(f"{name} {shown(value)}" for name, value in conditions[middle].items())
    ordered = {name: found[name] for name in designs if name in found}
    return [curves_plot("Curves of the best designs", ordered, f"Under {under}.")]


def _comparison(sweep: _Sweep, places: Sequence[int], comparisons: Sequence[Comparison]) -> list[Section]:
    if not comparisons:
        return []
    names = [sweep.table.names[place] for place in places]
    header = ("score", *names, *(f"{name} − {names[0]}" for name in names[1:]))
    rows = []
    for found in comparisons:
        differences = [
            _with_bounds(each) + (" *" if found.surely_differs(place) else "")
            for place, each in enumerate(found.against_first)
        ]
        each = [_with_error(one, found.error) for one in found.each]
        rows.append((sweep.label[found.score], *each, *differences[1:]))
    note = (
        "Means over the conditions that all finished, with 95 % confidence by bootstrap; differences are taken "
        "condition by condition; after ± the numerical error, where it was measured. * excludes zero and exceeds that "
        "error: the designs are told apart. With many scores, one in twenty excludes zero by chance."
    )
    drawn = comparisons[: max(2, min(4, len(sweep.study.objectives)))]
    variables = Table(
        "What is compared",
        ("variable", *names),
        [
            (sweep.label[name], *(shown(float(values[place])) for place in places))
            for name, values in sweep.table.variables.items()
        ],
    )
    return [variables, comparison_plot(drawn, names, sweep.label), Table("Comparison", header, rows, note)]


def _rows(table: DesignTable, places: Sequence[int], comparisons: Sequence[Comparison]) -> list[dict]:
    return [
        {
            "score": found.score,
            "design": table.names[place],
            "mean": found.each[index].mean,
            "low": found.each[index].low,
            "high": found.each[index].high,
            "difference": found.against_first[index].mean,
            "difference_low": found.against_first[index].low,
            "difference_high": found.against_first[index].high,
            "numerical_error": found.error and found.error.of(found.each[index].mean),
            "told_apart": found.surely_differs(index),
        }
        for found in comparisons
        for index, place in enumerate(places)
    ]


def _indices(sweep: _Sweep) -> list[Section]:
    if sweep.store.kind != "sensitivity":
        return []
    indices, left_out = sobol_indices(sweep.frame, sweep.study)
    rows = [
        (
            sweep.label[index.score],
            sweep.label[index.variable],
            f"{index.first:.3f} ± {index.first_confidence:.3f}",
            f"{index.total:.3f} ± {index.total_confidence:.3f}",
        )
        for index in indices
    ]
    note = (
        "Shares of each score's variance over the variables' distributions: what a variable makes alone, and with "
        f"others; ± 95 % confidence. {left_out:.0%} of the sample's points were left out: a design of theirs failed."
    )
    return [Table("Sobol's indices", ("score", "variable", "alone, S1", "in all, ST"), rows, note)]


def _failures(sweep: _Sweep) -> list[Section]:
    wrong = sweep.frame.filter(sweep.frame["state"].is_in(["failed", "diverged"]))
    if not len(wrong):
        return []
    kinds = Counter(zip(wrong["state"].to_list(), wrong["reason"].to_list(), strict=True))
    example = dict(zip(wrong["reason"].to_list(), wrong["job"].to_list(), strict=True))
    rows = [
        (state, str(number), reason, str(example[reason])) for (state, reason), number in kinds.most_common(_REASONS)
    ]
    note = "All of them are in results.csv." if len(kinds) > _REASONS else ""
    return [Table("What failed", ("state", "jobs", "why", "for example job"), rows, note)]


def _dictionary(study: Study) -> Table:
    rows = [(column.name, column.unit, column.meaning) for column in columns_of(study)]
    return Table("Columns of results.csv and results.parquet", ("column", "unit", "meaning"), rows)


def _provenance(store: SweepStore) -> Table:
    asked = {key: value for key, value in store.study.to_json().items() if key not in ("title", "sampler")}
    sampler = {key: value for key, value in store.study.to_json()["sampler"].items() if key != "designs"}
    return provenance_table({"study hash": store.study.hash, **asked, "sampler": sampler, "session": store.sessions()})


def _with_bounds(found: Interval) -> str:
    if found.low is None or found.high is None or found.low == found.high:
        return shown(found.mean)
    return f"{shown(found.mean)} ({shown(found.low)} to {shown(found.high)})"


def _with_error(found: Interval, error: ScoreError | None) -> str:
    return _with_bounds(found) + (f" ± {shown(error.of(found.mean))}" if error else "")
