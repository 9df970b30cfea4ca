"""The page about colons that move, from what `haustra bench motion` found."""

from collections.abc import Mapping, Sequence
from typing import Any

from haustra.scripts.bench.motion import COMPARED, DESIGN, FIRST_SEED, PLAIN, effects, soundness

_HEAD = """# Validation: colons that move

**Question.** Does the surface of a colon that moves stay a surface, and how much does the patient around it matter?

Made by `haustra bench motion -o DIR`; edit `scripts/bench/pages/motion_page.py`, not this page.

The model is told in [mesentery](../theory/mesentery.md). No figure here has been compared with a patient's colon: the
page says whether the moving surface stays a surface, and how much the patient around it matters in the model.
"""


def motion_page(measured: Mapping[str, Any]) -> str:
    """Markdown with both tables."""
    rows, seconds = measured["runs"], measured["seconds"]
    sound, grown = soundness(rows), [row for row in rows if row["colon"].startswith("grown")]
    colons = len({row["colon"] for row in grown})
    lines = [
        _HEAD,
        f"## The surface, in {sound['runs']} runs of {seconds:g} s\n",
        f"Scope {DESIGN}, lumen follower, {colons} grown colons from seed {FIRST_SEED} on in each patient below"
        f"{_others(rows)}. Every {measured['judged_every']:g} s, with the scope's own indentation:\n",
        "| figure | found | bound |",
        "| --- | --- | --- |",
        f"| largest share of triangles turned over against their own axis | {sound['turned_over_max_share']:.2%} | 0 |",
        f"| furthest that the scope's axis stands outside, by winding numbers"
        f" | {sound['outside_surface_max_mm']:.2f} mm | 0.5 mm |",
        f"| runs ended as escaped; of these with P(perforation) below 1"
        f" | {sound['escaped']}; {sound['escaped_unsaid']} | 0 unsaid |",
        f"| diverged | {sound['diverged']} | 0 |\n",
        "## The patient around it\n",
        "Change against the same colon as it was imaged and without gas, mean over colons with its 95 % interval"
        " (paired); **bold** where the interval leaves out 0.\n",
        "| patient | " + " | ".join(words for words, _ in COMPARED.values()) + " |",
        "| --- |" + " --- |" * len(COMPARED),
    ]
    for entry in effects(grown):
        lines.append(f"| {entry['patient']} | " + " | ".join(_told(entry, name) for name in COMPARED) + " |")
    return "\n".join(lines) + "\n"


def _others(rows: Sequence[Mapping[str, Any]]) -> str:
    names = sorted({row["colon"] for row in rows if not row["colon"].startswith("grown")})
    return f", and {', '.join(names)} as imaged" if names else ""


def _told(entry: Mapping[str, Any], name: str) -> str:
    found, decimals = entry[name], COMPARED[name][1]
    if entry["patient"] == PLAIN:
        return f"{found['mean']:.{decimals}f}"
    said = f"{found['change']:+.{decimals}f} ± {found['half_interval']:.{decimals}f}"
    return f"**{said}**" if abs(found["change"]) > found["half_interval"] else said
