"""A comparison of devices as a page, a table for a paper, and tables that other programs read."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.study.compare_passage import SITES
from haustra.envs.view.report.page import write_report
from haustra.envs.view.report.sections import Chart, Gallery, Picture, Section, Table, Warnings
from haustra.files import write_atomically

RUNS, DEVICES, PAIRS, WIDTHS, PAPER = "runs.csv", "devices.csv", "pairs.csv", "widths.csv", "paper.tex"
_ROWS = (
    ("caecal intubation", "intubation", "{:.0%}"),
    ("reach, share of the colon", "reach_mean", "{:.2f}"),
    ("time [s]", "time_mean_s", "{:.0f}"),
    ("peak wall force [N]", "wall_force_peak_mean_N", "{:.2f}"),
    ("mean wall force [N]", "wall_force_mean_N", "{:.2f}"),
    ("peak pressure on the wall [kPa]", "wall_pressure_peak_mean_kPa", "{:.1f}"),
    ("wall-force impulse per metre gained [N s/m]", "wall_impulse_mean_N_s_m", "{:.0f}"),
    ("colon moved [mm]", "colon_moved_mean_mm", "{:.0f}"),
    ("mesentery extension [mm]", "mesentery_extension_mean_mm", "{:.1f}"),
    ("mesentery extension per metre gained [mm/m]", "extension_per_metre_mean_mm_m", "{:.1f}"),
    ("P(perforation)", "p_perforation_mean", "{:.2g}"),
    ("pain, over where it is assumed to begin", "pain_mean", "{:.2f}"),
    ("mucosa seen on the way", "mucosa_seen_mean", "{:.0%}"),
    ("energy put in [J]", "work_mean_J", "{:.2g}"),
    ("begins at [m]", "begins_mean_m", "{:.2f}"),
)
_PICTURES = {
    "": "How the run in the first patient ended: the colon is drawn translucent.",
    "-close": "The device close by, there.",
}
_FILM = "The run in the first patient: what the tip saw, beside the colon from outside."
_ABOUT = (
    "Means over the same patients. Colon moved: the farthest that a place of it was moved from where it was at rest. "
    "Extension: the farthest that the mesentery, slack at rest, was drawn out beyond its slack. Mucosa: cells that "
    "were near and in view at one look at least. Energy: work of the hand along a scope, of the worm that turns "
    "treads, of all actuators of other devices. Scopes are driven by the lumen follower, other devices by the driver "
    "that comes with each."
)

ABOUT_SITES = "Mean over the patients of the largest there, over where pain is assumed to begin."
ABOUT_WIDTHS = "Speed while the tip was in lumens of that width at rest, standing still and all; what it gained there."


def report_comparison(folder: Path, found: Mapping[str, Any]) -> dict[str, str]:
    """Write the page, `paper.tex` and CSV files of what `haustra.envs.study.compare.compared` told.

    Returns:
        Paths of what was written.

    Raises:
        OutputError: when the folder cannot be written.
    """
    runs = [{name: value for name, value in run.items() if name != "curves"} for run in found["runs"]]
    devices = [_flat(one) for one in found["devices"]]
    widths = [{"device": one["name"], **band} for one in found["devices"] for band in one["advance_by_width"]]
    tables = {RUNS: runs, DEVICES: devices, PAIRS: found["pairs"], WIDTHS: widths}
    for name, rows in tables.items():
        _write(folder / name, _csv(rows))
    _write(folder / PAPER, _latex(found["devices"]))
    page = write_report(folder, title="Devices compared", subtitle=found["title"], sections=_sections(folder, found))
    return {"report": str(page), **{f"{Path(name).stem}_table": str(folder / name) for name in (*tables, PAPER)}}


_COUNTS = "stopped_by", "pain_sites"


def _flat(device: Mapping[str, Any]) -> dict[str, Any]:
    """A device's numbers in one row."""
    pain = {f"pain_{site}_mean": value for site, value in device["pain_by_site"].items()}
    rest = {name: value for name, value in device.items() if name not in ("pain_by_site", "advance_by_width")}
    return {**rest, **{name: _counted(device[name]) for name in _COUNTS}, **pain}


def device_rows(devices: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """What is told of each device, a row a score: its label, then a value a device."""
    rows = [[label, *(_shown(one[key], pattern) for one in devices)] for label, key, pattern in _ROWS]
    return [
        *rows,
        ["pain is largest at", *(_counted(one["pain_sites"]) for one in devices)],
        ["colon on its mesentery", *("yes" if one["on_mesentery"] else "no" for one in devices)],
        ["stopped by", *(_counted(one["stopped_by"]) for one in devices)],
        ["patients", *(str(one["patients"]) for one in devices)],
    ]


def site_rows(devices: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Pain at each site, a value a device."""
    return [
        [site.replace("_", " "), *(_shown(one["pain_by_site"][site], "{:.2f}") for one in devices)] for site in SITES
    ]


def width_rows(devices: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Speed and gain in lumens of each width, a value a device."""
    speeds = [{band["from_mm"]: band for band in one["advance_by_width"]} for one in devices]
    bands = sorted({(low, band["to_mm"]) for each in speeds for low, band in each.items()})
    return [[f"{low:.0f} to {high:.0f} mm", *(_band(each.get(low)) for each in speeds)] for low, high in bands]


def _sections(folder: Path, found: Mapping[str, Any]) -> list[Section]:
    devices = found["devices"]
    names = [one["name"] for one in devices]
    lost = [f"{one['device']} in {one['patient']}: {one['state']}. {one['reason']}" for one in found["lost"]]
    pairs = [
        [
            f"{pair['second']} − {pair['first']}",
            pair["score"].replace("_", " "),
            _shown(pair["difference"], "{:+.3g}"),
            "–" if pair["low"] is None else f"{pair['low']:+.3g} to {pair['high']:+.3g}",
            str(pair["patients"]),
        ]
        for pair in found["pairs"]
    ]
    pictures = [
        Picture(one["name"], path, caption)
        for one in devices
        for suffix, caption in _PICTURES.items()
        if (path := folder / "pictures" / f"{one['name']}{suffix}.png").is_file()
    ]
    sections: list[Section] = [
        Warnings(lost),
        Table("Devices in the same patients", ["", *names], device_rows(devices), _ABOUT),
        Gallery("Where they came to", pictures),
    ]
    if films := [film for one in devices if (film := folder / "pictures" / f"{one['name']}.webp").is_file()]:
        sections.append(Gallery("Films", [Picture(film.stem, film, _FILM) for film in films]))
    sections += [
        Table("Pain by site", ["", *names], site_rows(devices), ABOUT_SITES),
        Table("Lumen widths in which they work", ["lumen", *names], width_rows(devices), ABOUT_WIDTHS),
    ]
    if chart := _chart(found["runs"]):
        sections.append(chart)
    sections.append(
        Table(
            "Paired differences",
            ("pair", "score", "mean difference", "95 % interval", "patients"),
            pairs,
            "Second less first in the same patient; Student's interval.",
        )
    )
    return sections


def _band(band: Mapping[str, float] | None) -> str:
    return "–" if band is None else f"{band['speed_mm_s']:.1f} mm/s, {band['gained_m']:.2f} m"


def _chart(runs: Sequence[Mapping[str, Any]]) -> Chart | None:
    """Curves of the first patient."""
    first = [run for run in runs if run["patient"] == runs[0]["patient"]]
    longest = max((len(run["curves"]["time_s"]) for run in first), default=0)
    if longest < 2:
        return None
    time = max((run["curves"]["time_s"] for run in first), key=len)

    def panel(name: str) -> dict[str, np.ndarray]:
        full = {run["device"]: np.full(longest, np.nan) for run in first}
        for run in first:
            full[run["device"]][: len(run["curves"][name])] = run["curves"][name]
        return full

    panels = {
        "tip along the colon [m]": panel("tip_arc_m"),
        "wall force [N]": panel("wall_force_N"),
        "colon moved [mm]": panel("colon_moved_mm"),
    }
    return Chart("The first patient", "time [s]", np.array(time), panels)


def _shown(value: float | None, pattern: str) -> str:
    return "–" if value is None else pattern.format(value)


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in counts.items())


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()


def _latex(devices: Sequence[Mapping[str, Any]]) -> str:
    """A table for a paper, in LaTeX with booktabs."""
    head = " & ".join(["", *(_escaped(one["name"]) for one in devices)])
    lines = [
        " & ".join([_escaped(label), *(_escaped(_shown(one[key], pattern)) for one in devices)])
        for label, key, pattern in _ROWS
    ]
    body = " \\\\\n".join(lines)
    columns = "l" + "r" * len(devices)
    ends = f"\\begin{{tabular}}{{{columns}}}\n\\toprule\n", "\\bottomrule\n\\end{tabular}\n"
    return f"{ends[0]}{head} \\\\\n\\midrule\n{body} \\\\\n{ends[1]}"


def _escaped(text: str) -> str:
    return "".join(f"\\{letter}" if letter in "%&_#$" else letter for letter in text).replace("–", "--")


def _write(path: Path, text: str) -> None:
    write_atomically(path, lambda place: place.write_text(text, encoding="utf-8"))
