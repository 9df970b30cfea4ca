"""The report of one run, from what its folder holds."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.envs.console.motion import MOTION
from haustra.envs.view.report.page import write_report
from haustra.envs.view.report.sections import Chart, Gallery, Highlights, Picture, Player, Section, Table, Warnings
from haustra.envs.view.report.values import flat, name_and_unit, provenance_table, score_table, shown
from haustra.errors import UnreadableFileError
from haustra.provenance import file_hash
from haustra.reading import LARGEST_RECORD, read_arrays, read_document

TRAJECTORY = "trajectory.npz"
"""What was recorded over time; scores.json holds its hash."""
_HIGHLIGHTS = {
    "outcome": "Outcome",
    "tip_segment": "Tip is in",
    "tip_arc_m": "Tip along the colon",
    "insertion_m": "Scope inserted",
    "loops_at_end": "Loops at the end",
    "push_force_peak_N": "Largest push",
    "wall_force_peak_N": "Largest wall force",
    "p_perforation": "Share of people perforated",
    "perforation_site": "Likeliest perforated in",
    "pain_peak": "Pain, over where it is assumed to begin",
}
_PANELS = {
    "force [N]": {"hand, push": "push_force", "wall, hardest pressed link": "wall_force"},
    "torque [N m]": {"hand, torque": "torque"},
    "bend of the tip [rad]": {
        "up, asked for": "asked_up",
        "up": "bend_up",
        "left, asked for": "asked_left",
        "left": "bend_left",
    },
    "length [m]": {"scope inserted": "insertion", "tip along the colon": "tip_arc"},
}
"""Axis label, and for each curve its name and the array of trajectory.npz that holds it."""
_ERRORS = {
    "wall_force": ("mean sum of wall forces", "%"),
    "push": ("mean push", "%"),
    "tip_mm": ("path of the tip, median distance", "mm"),
}
"""Keys of scores.json's numerical error, their labels and units."""
_PICTURES = {
    "outside": (
        "From outside",
        "The colon is drawn translucent. White marks on a scope are 10 cm apart, from the tip.",
    ),
    "device": ("The device", "Close by, at the end of the run, in the colon."),
    "tip": ("From the tip", "What the tip camera sees at the end of the run."),
    "injury": (
        "Pain and tears",
        "Tension of wall or mesentery over that which is assumed to hurt, along the colon and over time; beside it the "
        "largest force on each place. Dashed: where the wall is likeliest torn.",
    ),
    "inspection": (
        "What was inspected",
        "The colon unrolled: mucosa that was in view for long enough on the way out, and polyps seen and missed.",
    ),
    "scene": ("As MuJoCo sees it", "The compiled scene, drawn by MuJoCo's own renderer."),
}


def report_run(folder: Path) -> Path:
    """Write `report.html` into a run's folder, from its scores.json, trajectory.npz and pictures.

    Returns:
        The report's path.

    Raises:
        UnreadableFileError: when the folder holds no finished run, or parts of two.
        OutputError: when the report cannot be written.
    """
    scores = _read_scores(folder / "scores.json")
    known = scores.get("trajectory")
    if known is not None and (folder / TRAJECTORY).is_file() and file_hash(folder / TRAJECTORY) != known:
        raise UnreadableFileError(f"The files in '{folder}' are of two runs: run it again, into a new folder.")
    sections: list[Section] = [Highlights(_highlights(scores))]
    sections.append(Warnings([str(message) for message in scores.get("warnings", ())]))
    sections += _player(folder / MOTION)
    if pictures := _pictures(folder):
        sections.append(Gallery("The end of the run", pictures))
    if chart := _chart(folder / TRAJECTORY):
        sections.append(chart)
    sections.append(score_table(scores, leave_out=("provenance", "warnings", "numerical_error", "trajectory")))
    sections += _numerical_error(scores.get("numerical_error"))
    sections.append(provenance_table(scores.get("provenance", {})))
    return write_report(
        folder, title="A colonoscope's way through a colon", subtitle=_subtitle(scores), sections=sections
    )


def _read_scores(path: Path) -> dict:
    scores = read_document(path, "scores of a run", largest=LARGEST_RECORD)
    if not isinstance(scores, dict):
        raise UnreadableFileError(f"'{path}' holds no scores. Name a folder that `haustra run` wrote.")
    return scores


def _subtitle(scores: Mapping[str, object]) -> str:
    """Name of the colon and of the design, as far as the provenance tells them."""
    named = dict(flat(provenance)) if isinstance(provenance := scores.get("provenance"), Mapping) else {}
    wanted = ("inputs · colon_name", "configuration · design · name")
    return " · ".join(str(named[key]) for key in wanted if key in named)


def _highlights(scores: Mapping[str, object]) -> dict[str, str]:
    return {
        label: f"{shown(scores[key])} {name_and_unit(key)[1]}".strip().replace("_", " ")
        for key, label in _HIGHLIGHTS.items()
        if key in scores
    }


def _player(path: Path) -> list[Section]:
    """The run as it went, where its folder holds that."""
    if not path.is_file():
        return []
    motion = read_document(path, "motion of a run", largest=LARGEST_RECORD)
    if not isinstance(motion, list) or not all(isinstance(one, str) for one in motion):
        raise UnreadableFileError(f"'{path}' holds no motion of a run: run it again.")
    return [Player("The run", motion, "Drag to turn. The wall is red where a link presses with 15 N or more.")]


def _numerical_error(stated: object) -> list[Section]:
    """Ranges of errors with what they were measured on, and how the run differs from its own repeats."""
    if not isinstance(stated, Mapping):
        return []
    rows = [(label, _ends(stated.get(key), unit)) for key, (label, unit) in _ERRORS.items()]
    sections: list[Section] = [Table("Numerical error", ("of", "range"), rows, f"{stated.get('measured_on', '')}.")]
    repeats = stated.get("differences")
    if isinstance(repeats, Mapping) and repeats:
        names = list(next(iter(repeats.values())))
        differences = [(name.replace("_", " "), *(shown(each[name]) for each in repeats.values())) for name in names]
        note = "Forces: relative, the repeat less the run. A link of half the length bears less of a spread load."
        sections.append(Table("Differences from its repeats", ("score", *repeats), differences, note))
    return sections


def _ends(ends: object, unit: str) -> str:
    match ends:
        case [int() | float() as low, int() | float() as high]:
            scale = 100 if unit == "%" else 1
            return f"{scale * low:.2g} to {scale * high:.2g} {unit}"
    return "not measured"


def _pictures(folder: Path) -> list[Picture]:
    found = [(name, folder / f"{name}.png") for name in _PICTURES]
    return [Picture(_PICTURES[name][0], path, _PICTURES[name][1]) for name, path in found if path.is_file()]


def _chart(path: Path) -> Chart | None:
    if not path.is_file():
        return None
    wanted = {"time", *(key for curves in _PANELS.values() for key in curves.values())}
    recorded = read_arrays(path, sorted(wanted), some=True)
    if len(recorded.get("time", ())) < 2:
        return None
    return Chart("Over time", "time [s]", recorded["time"], _panels(recorded))


def _panels(recorded: Mapping[str, Float[np.ndarray, " samples"]]) -> dict[str, dict[str, np.ndarray]]:
    panels = {
        label: {name: recorded[key] for name, key in curves.items() if key in recorded}
        for label, curves in _PANELS.items()
    }
    return {label: curves for label, curves in panels.items() if curves}
