"""The page of devices in the same patients, from what `haustra compare … --json` printed.

`python -m haustra.scripts.bench.pages.compare_page docs/validation/devices.md standard=standard.json` writes it, and
docs/validation/data/devices.json, which it is made from.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.envs.view.report.compare_report import ABOUT_SITES, ABOUT_WIDTHS, device_rows, site_rows, width_rows
from haustra.files import write_atomically, write_json
from haustra.reading import LARGEST_RECORD, read_document

_PAIRED = {
    "reach": "reach, share of the colon",
    "wall_force_peak_N": "peak wall force [N]",
    "mesentery_extension_mm": "mesentery extension [mm]",
    "pain": "pain",
    "mucosa_seen": "mucosa seen",
}


def compare_page(kept: Mapping[str, Any]) -> str:
    """The page as Markdown, of cohorts by name."""
    lines = [
        "# Validation: devices in the same patients",
        "",
        "**Question.** How far does each device come, and what does it do to the same colons?",
        "",
        "Made by `python -m haustra.scripts.bench.pages.compare_page` from docs/validation/data/devices.json, which "
        "holds what `haustra compare` printed; do not edit. What is measured, what is assumed and who drives stands in "
        "[Devices side by side](../studies/devices.md). No real device was measured: nothing here ranks products.",
    ]
    for cohort, found in kept["cohorts"].items():
        names = [one["name"] for one in found["devices"]]
        header = ["", *names]
        lines += ["", f"## Cohort {cohort}", "", f"`haustra compare {' '.join(names)} --cohort {cohort} --json -o DIR`"]
        lines += ["", *_table(header, device_rows(found["devices"])), "", *_ratios(found["devices"])]
        if found["lost"]:
            lost = ", ".join(f"{one['device']} in {one['patient']} ({one['state']})" for one in found["lost"])
            lines += ["", f"Lost: {lost}."]
    last = list(kept["cohorts"].values())[-1]
    header = ["", *(one["name"] for one in last["devices"])]
    lines += ["", f"## In cohort {list(kept['cohorts'])[-1]}", "", f"**Pain by site.** {ABOUT_SITES}", ""]
    lines += _table(header, site_rows(last["devices"]))
    lines += [
        "",
        f"**Lumen widths in which they work.** {ABOUT_WIDTHS}",
        "",
        *_table(header, width_rows(last["devices"])),
    ]
    lines += [
        "",
        "**Paired differences**, first device less second, with Student's 95 % intervals.",
        "",
        *_pairs(last["pairs"]),
    ]
    return "\n".join(lines) + "\n"


def _ratios(devices: Sequence[Mapping[str, Any]]) -> list[str]:
    """The everting endoscope's extension of the mesentery over the scope's, for which 0.2 is published."""
    by = {one["name"]: one for one in devices}
    if not {"scope", "vine"} <= set(by):
        return []
    names = {"mesentery_extension_mean_mm": "extension", "extension_per_metre_mean_mm_m": "extension per metre gained"}
    told = [f"{label} {by['vine'][key] / by['scope'][key]:.2f}" for key, label in names.items() if by["scope"][key]]
    return [f"Vine over scope, of these means: {', '.join(told)} (published: 0.2)."]


def _pairs(pairs: Sequence[Mapping[str, Any]]) -> list[str]:
    found: dict[tuple[str, str], dict[str, str]] = {}
    for pair in pairs:
        if pair["score"] in _PAIRED:
            known = pair["difference"] is not None and pair["low"] is not None
            said = f"{pair['difference']:+.3g} ({pair['low']:+.3g} to {pair['high']:+.3g})" if known else "–"
            found.setdefault((pair["second"], pair["first"]), {})[pair["score"]] = said
    rows = [
        [f"{second} − {first}", *(own.get(score, "–") for score in _PAIRED)] for (second, first), own in found.items()
    ]
    return _table(["pair", *_PAIRED.values()], rows)


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    head = [f"| {' | '.join(header)} |", "|" + "---|" * len(header)]
    return head + [f"| {' | '.join(row)} |" for row in rows]


def main(page: Path, sources: Mapping[str, Path]) -> None:
    """Keep what was printed of each cohort beside the page, and write the page."""
    read = {name: read_document(path, "comparison", largest=LARGEST_RECORD) for name, path in sources.items()}
    kept = {"cohorts": {name: {key: told[key] for key in ("devices", "pairs", "lost")} for name, told in read.items()}}
    write_json(page.parent / "data" / f"{page.stem}.json", kept)
    write_atomically(page, lambda path: path.write_text(compare_page(kept), encoding="utf-8"))


if __name__ == "__main__":
    named = (argument.split("=", 1) for argument in sys.argv[2:])
    main(Path(sys.argv[1]), {name: Path(path) for name, path in named})
