"""The picture of grown colons against published anatomy."""

from collections.abc import Mapping, Sequence
from pathlib import Path

_PANELS = (
    ("total.length_m", "whole length [m]", 1.0, ("japan-ctc", "us-ctc")),
    ("length_m", "length of the segments [cm], japan-ctc", 100.0, ("japan-ctc",)),
    ("diameter_m", "effective diameter of the segments [mm]", 1000.0, ("japan-ctc",)),
    ("total.flexures", "acute flexures a colon", 1.0, ("japan-ctc", "us-ctc")),
    ("arc_over_chord", "arc over chord of the segments", 1.0, ("japan-ctc",)),
    ("diameter_sd_m", "sd of the diameter along a segment [mm]", 1000.0, ("japan-ctc",)),
)
_GROWN, _SOURCE, _REAL = "#7fa6cf", "#b5473c", ("#2f2f2f", "#8a5cb8", "#4b8b4b", "#c98a1b")


def draw(path: Path, rows: Sequence[Mapping], verdicts: Sequence, real: Mapping[str, Mapping[str, float]]) -> Path:
    """Box plots of the cases, the published intervals beside them, and imported colons as points."""
    import matplotlib.pyplot as plt

    from haustra.files import write_atomically

    figure, axes = plt.subplots(2, 3, figsize=(13.5, 7.6), layout="constrained")
    for panel, (measure, title, scale, cohorts) in zip(axes.flat, _PANELS, strict=True):
        labels = _groups(measure, rows, cohorts)
        for place, (label, name, chosen) in enumerate(labels):
            values = [scale * row[name] for row in chosen if name in row]
            panel.boxplot(
                [values],
                positions=[place - 0.14],
                widths=0.3,
                whis=(5, 95),
                patch_artist=True,
                boxprops={"facecolor": _GROWN},
                medianprops={"color": "black"},
                flierprops={"marker": ".", "markersize": 3},
            )
            _published(panel, place + 0.22, scale, name, label, verdicts)
            for number, measured in enumerate(real.values()):
                if name in measured:
                    colour = _REAL[number % len(_REAL)]
                    panel.plot(place + 0.36, scale * measured[name], "D", color=colour, ms=4.5)
        panel.set(title=title, ylim=(0, None))
        panel.set_xticks(range(len(labels)), [label for label, _, _ in labels], fontsize=8)
        panel.grid(axis="y", alpha=0.3)
    figure.legend(handles=_legend(rows, real), loc="outside lower center", ncols=4, frameon=False)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=110))
    plt.close(figure)
    return path


def _groups(measure: str, rows: Sequence[Mapping], cohorts: Sequence[str]) -> list[tuple[str, str, list[Mapping]]]:
    """Label, name of the measure and cases of each box of a panel."""
    if measure.startswith("total."):
        groups = []
        for cohort in cohorts:
            chosen = [row for row in rows if row["cohort"] == cohort]
            groups.append((cohort, measure, chosen))
            for sex in ("female", "male") if measure == "total.length_m" else ():
                groups.append((f"{cohort}\n{sex}", measure, [row for row in chosen if row["sex"] == sex]))
        return [group for group in groups if group[2]]
    from haustra.models.anatomy.landmarks import SEGMENTS

    chosen = [row for row in rows if row["cohort"] in cohorts]
    return [(name, f"{name}.{measure}", chosen) for name in SEGMENTS]


def _published(panel, place: float, scale: float, name: str, label: str, verdicts: Sequence) -> None:
    """Published ranges as thin bars, means with their standard deviation as points with thick bars."""
    cohort = label.replace("\n", " ")
    figures = [verdict.published for verdict in verdicts if verdict.published.measure == name]
    named = [figure for figure in figures if figure.group == cohort]
    for figure in named or [figure for figure in figures if not name.startswith("total.")]:
        if figure.low is not None and figure.high is not None:
            panel.plot([place] * 2, [scale * figure.low, scale * figure.high], color=_SOURCE, lw=1.2)
        if figure.mean is not None:
            spread = scale * (figure.sd or 0.0)
            panel.errorbar(place, scale * figure.mean, spread, fmt="o", color=_SOURCE, ms=4, lw=3, alpha=0.8)


def _legend(rows: Sequence[Mapping], real: Mapping[str, object]) -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Patch(
            facecolor=_GROWN, edgecolor="black", label=f"{len(rows)} grown colons: quartiles, 5th to 95th percentile"
        ),
        Line2D([], [], color=_SOURCE, lw=3, marker="o", ms=4, label="published: mean, standard deviation"),
        Line2D([], [], color=_SOURCE, lw=1.2, label="published: range (diameters: 5 to 95 % along a CT colon)"),
    ]
    for number, name in enumerate(real):
        handles.append(Line2D([], [], ls="", marker="D", ms=4.5, color=_REAL[number % len(_REAL)], label=name))
    return handles
