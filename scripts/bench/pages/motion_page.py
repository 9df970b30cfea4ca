"""The page about colons that move, from what `haustra bench motion` found."""

from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any

from haustra.scripts.bench.motion import AGAINST, COMPARED, DESIGN, FIRST_SEED, PATIENTS, PLAIN, effects, soundness

_HEAD = """# Validation: colons that move

**Question.** Does the surface of a colon that moves stay a surface, and how much does the patient around it matter?

Made from docs/validation/data/motion.json, which `haustra bench motion -o DIR` leaves; edit
`scripts/bench/pages/motion_page.py`, not this page.

The model is told in [mesentery](../theory/mesentery.md). No figure here has been compared with a patient's colon: the
page says whether the moving surface stays a surface, and how much the patient around it matters in the model.
"""


_SAID = """Runs whose scope was looked for at every record are of 26 November 2026, others of 25 November, on {machine}.
Places of the scope's axis are looked up in the colon's table where the colon is, triangles are laid beside those that
are close to the wall, and the whole surface and its winding numbers only where that leaves it open. Loops are drawn to
the shaft ([mesentery](../theory/mesentery.md)); before, one run in 832 left triangles of a grown colon turned over, and
both in EdinGCA_3D_00020 ended as escaped. Pictures are drawn of the wall's inner sides only. A camera may stand within
the colon and have another loop's wall across its view, since loops pass through each other unless a run asks for
`--loops-touch`.
"""


_COSTS = """
Processor time of a step in linear time over that of the colon as imaged, one core, scopes pushed in; at most 1.5 is the
bar, with everything on. Other patients are numbers of the axis and cost nothing. Gas holds the lumen narrower at first,
so that more is touched:
"""


def motion_page(measured: Mapping[str, Any]) -> str:
    """Markdown with a table of soundness for each kind of colon and driver, and one of what patients change."""
    kinds = _kinds(measured["runs"])
    sound = [soundness(rows) for rows in kinds.values()]
    lines = [
        _HEAD,
        "## The surface\n",
        f"Scope {DESIGN}; the lumen follower, and the policy `insertion` that ships; grown colons from seed"
        f" {FIRST_SEED} on, others as imaged. With the scope's own indentation:\n",
        "| figure | " + " | ".join(kinds) + " | bound |",
        "| --- |" + " --- |" * (len(kinds) + 1),
        *(_line(figure, [told(found) for found in sound], bound) for figure, told, bound in _FIGURES),
        "",
        _SAID.format(machine=measured.get("machine", "shared cores beside other work")),
    ]
    found = effects([row for row in measured["runs"] if _grown(row)])
    if found:
        lines += [
            "## The patient around it\n",
            "Change against the same colon as it was imaged and without gas, lumen follower, mean over colons with its"
            " 95 % interval (paired, runs as long as each other); **bold** where the interval leaves out 0. A number of"
            " colons stands where it is not all of them: water that hurts before a scope is in is refused by name.\n",
            "| patient | " + " | ".join(words for words, _ in COMPARED.values()) + " |",
            "| --- |" + " --- |" * len(COMPARED),
        ]
    for entry in found:
        fewer = f" ({entry['colons']} colons)" if entry["colons"] < found[0]["colons"] else ""
        other = f", against {entry['against']}" if entry["against"] != PLAIN else ""
        lines.append(
            f"| {entry['patient']}{other}{fewer} | " + " | ".join(_told(entry, name) for name in COMPARED) + " |"
        )
    lines += _not_compared(measured["runs"], {entry["patient"] for entry in found})
    if costs := measured.get("costs"):
        lines += [_COSTS, "| patient | one scope | 128 scopes |", "| --- | --- | --- |"]
        lines += [
            f"| {name} | " + " | ".join(f"{ratio:.2f}" for ratio in found) + " |" for name, found in costs.items()
        ]
    return "\n".join(lines) + "\n"


_FIGURES: Sequence[tuple[str, Callable[[Mapping[str, Any]], str], str]] = (
    ("runs", lambda found: str(found["runs"]), ""),
    (
        "runs in which triangles turned over against their own axis",
        lambda found: str(found["turned_over_runs"]),
        "0",
    ),
    ("largest share of triangles", lambda found: f"{found['turned_over_max_share']:.3%}", "0"),
    (
        "furthest that the scope's axis stands outside",
        lambda found: f"{found['outside_surface_max_mm']:.2f} mm",
        "0.5 mm",
    ),
    (
        "records of a run at which that was seen",
        lambda found: " to ".join(map(str, dict.fromkeys(found["outside_surface_records"]))),
        "all, 50 a second",
    ),
    (
        "both at all records but the last, at which an escape is found",
        lambda found: _before_end(found),
        "0; 0.5 mm",
    ),
    (
        "ended as escaped; of these with P(perforation) below 1",
        lambda found: f"{found['escaped']}; {found['escaped_unsaid']}",
        "0 unsaid",
    ),
    ("diverged", lambda found: str(found["diverged"]), "0"),
    (
        "least share of a last picture from the tip that is mucosa",
        lambda found: _if_drawn(found, "{last_picture_mucosa_min_share:.1%}"),
        "",
    ),
    (
        "last pictures whose camera stands outside the colon; of all that were judged",
        lambda found: _if_drawn(found, "{last_pictures_from_outside}; {pictures_from_outside}"),
        "0",
    ),
    (
        "largest share of a last picture across which another loop's wall stands",
        lambda found: _if_drawn(found, "{last_picture_across_max_share:.1%}"),
        "",
    ),
    (
        "runs in which one does at any time",
        lambda found: _if_drawn(found, "{pictures_across_runs}"),
        "",
    ),
)
"""Rows of the table of soundness: words, how what was found is told, and the bound."""


def _kinds(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Runs that go into a column together: of grown colons, or of one other, by one driver, for as long."""
    alike: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        kind = "" if _grown(row) else row["colon"]
        alike.setdefault((kind, row["driver"], row["seconds"], row["judged_every"]), []).append(row)
    return {_heading(*key, own=own): own for key, own in sorted(alike.items(), key=lambda item: item[0])}


def _heading(kind: str, driver: str, seconds: float, every: float, *, own: Sequence[Mapping[str, Any]]) -> str:
    named = kind or f"{len({row['colon'] for row in own})} grown colons"
    return f"{named}, {driver}, {seconds:g} s, judged every {every:g} s"


def _not_compared(rows: Sequence[Mapping[str, Any]], compared: Set[str]) -> list[str]:
    """Rows of patients of grown colons that were run without those whom they are compared with."""
    left = {row["patient"] for row in rows if _grown(row)} - compared
    empty = " |" * len(COMPARED)
    return [
        f"| {name} | not compared: nobody was run with {AGAINST.get(name, PLAIN)}{empty}"
        for name in PATIENTS
        if name in left - {PLAIN}
    ]


def _grown(row: Mapping[str, Any]) -> bool:
    return row["colon"].startswith("grown")


def _before_end(found: Mapping[str, Any]) -> str:
    if found["turned_over_before_end"] is None:
        return "not told apart"
    return f"{found['turned_over_before_end']:.3%}; {found['outside_before_end_mm']:.2f} mm"


def _if_drawn(found: Mapping[str, Any], told: str) -> str:
    return told.format(**found) if found["pictures"] == found["runs"] else "not looked at"


def _line(figure: str, found: Sequence[str], bound: str = "") -> str:
    return f"| {figure} | {' | '.join(found)} | {bound} |"


def _told(entry: Mapping[str, Any], name: str) -> str:
    found, decimals = entry[name], COMPARED[name][1]
    if entry["patient"] == PLAIN:
        return f"{found['mean']:.{decimals}f}"
    said = f"{found['change']:+.{decimals}f} ± {found['half_interval']:.{decimals}f}"
    return f"**{said}**" if abs(found["change"]) > found["half_interval"] else said
