"""The page of how far tracked robots come, from what `haustra bench reach` kept.

`python -m haustra.scripts.bench.pages.reach_page reach.json docs/validation/reach.md` writes it.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.reading import read_document

_SEARCH = (
    "`tracked-far` was found by `haustra optimise tracked-reach` in three other colons (runs of 150 s, two generations "
    "of 28 designs, ended by a limit of time when 18 designs had been through all three; 150 s of 26 Xeon cores beside "
    "other work, 25 November 2026). Four came 0.65 m, within 1 % of each other; it is the one of them that pressed on "
    "the wall least. Its price is pressure, since it presses on narrower tips. `tracked-wide` was chosen by hand. In "
    "that search folded treads left the core bare at its ends; they have not since 26 November 2026.",
    "",
)


def reach_page(kept: Mapping[str, Any]) -> str:
    """The page as Markdown; the first robot is what the others are compared with."""
    found = kept["robots"]
    base = found[next(iter(found))]["summary"]
    lines = [
        "# How far the tracked robot comes",
        "",
        f"`haustra bench reach -o DIR`: {base['colons']} grown colons from seed 300000 on, on their mesentery, each "
        f"run up to {kept['seconds']:g} s, from where the robot fits first, by its own driver; a run that comes no "
        "further for 10 s is over. Nothing here was measured on a real robot. Pressure is that of a tip, a ball as "
        "wide as a tread, on the patch of wall under it.",
        "",
        *_summaries(found),
        "",
        *_SEARCH,
        "## What sets them apart",
        "",
        "Bellows that are 'held' are regulated to press by their preload at any width; 'closed' ones are springs.",
        "",
        *_designs(found),
        "",
        *_within(found),
        "## Why it stops",
        "",
        *_reasons(found),
        "",
        f"Each run of `{next(iter(found))}`; the last three columns are means over its last 5 s, the core's force over "
        "that of the treads.",
        "",
        *_runs(found[next(iter(found))]["runs"]),
        "",
        "## Held by a string in a straight tube",
        "",
        "The robot that drives in colons, in a tube of its nominal diameter, against the closed form of the rigs "
        "(`drive_point`; the rigs agree with it within 0.1 %). Ripple: of the string's force, and of one track's "
        "normal force at the tooth-passing frequency; struts on bellows give way, so it goes into their motion. "
        "Stress: of the belt above a tip at the tip's mean load, from the finite elements. Slip: friction's work on "
        "the wall.",
        "",
        *_held(found),
    ]
    return "\n".join(lines) + "\n"


def _summaries(found: Mapping[str, Any]) -> list[str]:
    first = next(iter(found))
    lines = [
        "| robot | colons | came, mean (median) | of the colon, mean | force a track, mean | largest wall force, mean |"
        " pressure, mean (largest) | work of slip | way over the first's, same colons |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, each in found.items():
        got = each["summary"]
        ratio = _ratio(found[first]["runs"], each["runs"])
        lines.append(
            f"| {name} | {got['colons']} | {got['came_mean_m']:.3f} m ({got['came_median_m']:.3f}) | "
            f"{100 * got['reach_mean']:.0f} % | {got['track_force_mean_N']:.2f} N | {got['wall_force_peak_N']:.2f} N | "
            f"{got['wall_pressure_mean_kPa']:.0f} ({got['wall_pressure_peak_kPa']:.0f}) kPa | "
            f"{1e3 * got['slip_work_mean_J']:.0f} mJ | {ratio:.2f} x |"
        )
    return lines


def _designs(found: Mapping[str, Any]) -> list[str]:
    quantities = {
        "nominal_diameter_mm": "nominal diameter, track to track [mm]",
        "smallest_diameter_mm": "smallest [mm]",
        "largest_diameter_mm": "largest [mm]",
        "core_length_mm": "length of the core [mm]",
        "core_diameter_mm": "its diameter [mm]",
        "bellows_stiffness_N_m": "stiffness of a bellows [N/m]",
        "bellows_preload_N": "its preload [N]",
        "torque_limit_mNm": "torque limit of the shaft [mN m]",
        "regulation": "bellows",
    }
    lines = [f"| | {' | '.join(found)} |", "|---" * (1 + len(found)) + "|"]
    for name, about in quantities.items():
        told = (each["design"][name] for each in found.values())
        cells = (value if isinstance(value, str) else f"{value:.3g}" for value in told)
        lines.append(f"| {about} | {' | '.join(cells)} |")
    return lines


def _within(found: Mapping[str, Any]) -> list[str]:
    """How far each came in imported colons from several starts; nothing where there are none."""
    colons = list(next(iter(found.values())).get("within", {}))
    if not colons:
        return []
    asked = ", ".join(f"{row['asked_m']:g}" for row in next(iter(found.values()))["within"][colons[0]])
    lines = [
        "## In colons of real people",
        "",
        f"`--within FOLDER`: from where the robot fits next to {asked} m, in that order. Nothing that ships was chosen "
        "by these.",
        "",
        "| colon | robot | came, mean | from each start | stopped by |",
        "|---|---|---|---|---|",
    ]
    for colon in colons:
        for name, each in found.items():
            rows = each["within"][colon]
            ways = [row["came_m"] for row in rows]
            reasons = [row["stopped_by"] for row in rows]
            told = ", ".join(f"{reason} ({reasons.count(reason)})" for reason in dict.fromkeys(reasons))
            lines.append(
                f"| {colon} | {name} | {sum(ways) / len(ways):.3f} m | "
                f"{', '.join(f'{way:.3f}' for way in ways)} | {told} |"
            )
    return [*lines, ""]


def _reasons(found: Mapping[str, Any]) -> list[str]:
    lines = ["| robot | by |", "|---|---|"]
    for name, each in found.items():
        reasons = ", ".join(f"{reason} ({count})" for reason, count in each["summary"]["stopped_by"].items())
        lines.append(f"| {name} | {reasons} |")
    return lines


def _runs(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    lines = [
        "| colon | began | came | after | stopped by | in | lumen there | across tracks | worm at | core over treads |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in runs:
        if row["start_m"] is None:
            lines.append(f"| {row['seed']} | – | 0 m | – | {row['stopped_by']} | – | – | – | – | – |")
            continue
        core = row["core_force_there"] / max(row["normal_there"], 1e-9)
        lines.append(
            f"| {row['seed']} | {row['start_m']:.2f} m | {row['came_m']:.3f} m | {row['simulated_s']:.0f} s | "
            f"{row['stopped_by']} | {row['stopped_in']} | {1e3 * row['lumen_there_m']:.0f} mm | "
            f"{1e3 * row['width_there']:.0f} mm | {100 * row['worm_share_there']:.0f} % | {core:.2f} |"
        )
    return lines


def _held(found: Mapping[str, Any]) -> list[str]:
    lines = [
        "| robot | surface | rpm | string | against closed form | ripple, string | ripple, track | "
        "stress, mean (peak) | slip |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, each in found.items():
        for row in each["held"]:
            lines.append(
                f"| {name} | {row['surface']} | {row['rpm']:g} | {1e3 * row['force_N']:.1f} mN | "
                f"{100 * row['difference']:+.1f} % | {100 * row['ripple']:.1f} % | "
                f"{100 * row['track_ripple']:.1f} % | {row['stress_mean_kPa']:.0f} ({row['stress_peak_kPa']:.0f}) kPa "
                f"| {1e3 * row['slip_power_W']:.2f} mW |"
            )
    return lines


def _ratio(first: Sequence[Mapping[str, Any]], other: Sequence[Mapping[str, Any]]) -> float:
    """Way that another robot came over the first's, in the colons that both were driven in."""
    ways = {row["seed"]: row["came_m"] for row in first}
    both = [(ways[row["seed"]], row["came_m"]) for row in other if row["seed"] in ways]
    before, after = (sum(column) for column in zip(*both, strict=True)) if both else (0.0, 0.0)
    return after / before if before else float("nan")


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(reach_page(read_document(Path(sys.argv[1]), "runs")), encoding="utf-8")
