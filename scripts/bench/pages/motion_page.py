"""The page about colons that move, from what `haustra bench motion` found."""

from collections.abc import Mapping, Sequence
from typing import Any

from haustra.scripts.bench.motion import COMPARED, DESIGN, FIRST_SEED, PLAIN, effects, soundness

_HEAD = """# Validation: colons that move

**Question.** Does the surface of a colon that moves stay a surface, and how much does the patient around it matter?

Made from docs/validation/data/motion.json, which `haustra bench motion -o DIR` leaves; edit
`scripts/bench/pages/motion_page.py`, not this page.

The model is told in [mesentery](../theory/mesentery.md). No figure here has been compared with a patient's colon: the
page says whether the moving surface stays a surface, and how much the patient around it matters in the model.
"""


_SAID = """Where triangles of a grown colon are left turned over, the shaft has left the inside of a bend both ways: the
bend's loop is empty, and the scope no longer follows the colon ([known limits](../limits.md)).
"""


_COSTS = """
Processor time of a step in linear time over that of the colon as imaged, one core, scopes pushed in; other patients are
numbers of the axis and cost nothing:
"""


def motion_page(measured: Mapping[str, Any]) -> str:
    """Markdown with a table of soundness for each kind of colon, and one of what patients change."""
    grown = [row for row in measured["runs"] if row["colon"].startswith("grown")]
    real = [row for row in measured["runs"] if row not in grown]
    kinds = {f"{len({row['colon'] for row in grown})} grown colons": grown}
    kinds |= {name: [row for row in real if row["colon"] == name] for name in sorted({row["colon"] for row in real})}
    sound = [soundness(rows) for rows in kinds.values()]
    lines = [
        _HEAD,
        "## The surface\n",
        f"Scope {DESIGN}, lumen follower; grown colons from seed {FIRST_SEED} on in each patient below, others as"
        " imaged. With the scope's own indentation:\n",
        "| figure | " + " | ".join(kinds) + " | bound |",
        "| --- |" + " --- |" * (len(kinds) + 1),
        _line(
            "runs",
            [f"{found['runs']} of {_told_times(rows)}" for found, rows in zip(sound, kinds.values(), strict=True)],
        ),
        _line(
            "runs in which triangles turned over against their own axis",
            [str(found["turned_over_runs"]) for found in sound],
            "0",
        ),
        _line("largest share of triangles", [f"{found['turned_over_max_share']:.3%}" for found in sound], "0"),
        _line(
            "furthest that the scope's axis stands outside, by winding numbers",
            [f"{found['outside_surface_max_mm']:.2f} mm" for found in sound],
            "0.5 mm",
        ),
        _line(
            "ended as escaped; of these with P(perforation) below 1",
            [f"{found['escaped']}; {found['escaped_unsaid']}" for found in sound],
            "0 unsaid",
        ),
        _line("diverged", [str(found["diverged"]) for found in sound], "0"),
        "",
        _SAID,
        "## The patient around it\n",
        "Change against the same colon as it was imaged and without gas, mean over colons with its 95 % interval"
        " (paired); **bold** where the interval leaves out 0. A number of colons stands where it is not all of them:"
        " those runs were added later.\n",
        "| patient | " + " | ".join(words for words, _ in COMPARED.values()) + " |",
        "| --- |" + " --- |" * len(COMPARED),
    ]
    found = effects(grown)
    for entry in found:
        fewer = f" ({entry['colons']} colons)" if entry["colons"] < found[0]["colons"] else ""
        lines.append(f"| {entry['patient']}{fewer} | " + " | ".join(_told(entry, name) for name in COMPARED) + " |")
    if costs := measured.get("costs"):
        lines += [_COSTS, "| patient | one scope | 128 scopes |", "| --- | --- | --- |"]
        lines += [
            f"| {name} | " + " | ".join(f"{ratio:.2f}" for ratio in found) + " |" for name, found in costs.items()
        ]
    return "\n".join(lines) + "\n"


def _line(figure: str, found: Sequence[str], bound: str = "") -> str:
    return f"| {figure} | {' | '.join(found)} | {bound} |"


def _told_times(rows: Sequence[Mapping[str, Any]]) -> str:
    return f"{rows[0]['seconds']:g} s, judged every {rows[0]['judged_every']:g} s"


def _told(entry: Mapping[str, Any], name: str) -> str:
    found, decimals = entry[name], COMPARED[name][1]
    if entry["patient"] == PLAIN:
        return f"{found['mean']:.{decimals}f}"
    said = f"{found['change']:+.{decimals}f} ± {found['half_interval']:.{decimals}f}"
    return f"**{said}**" if abs(found["change"]) > found["half_interval"] else said
