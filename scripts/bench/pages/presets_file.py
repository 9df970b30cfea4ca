"""Write assets/presets.toml from accuracy.json: `python -m haustra.scripts.bench.pages.presets_file accuracy.json`."""

import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.assets import asset
from haustra.files import write_atomically
from haustra.models.presets import PRESETS

_ENTRIES = {
    "tip path": ("tip_error", "m", 1e-3, "median distance of the tip from that of a converged run, same script"),
    "push force": ("push_error", "1", 1.0, "relative error of the mean push"),
    "wall force": ("wall_force_error", "1", 1.0, "relative error of the mean sum of wall forces"),
}


def presets_toml(result: Mapping[str, Any]) -> str:
    """The file's text: the value is that of the grown colon, the range spans every colon that was measured."""
    date, processor = result["machine"]["date"], result["machine"]["processor"]
    lines = [
        "# How far each preset is off and how fast it runs, in an insertion of an adult scope.",
        "# Made by haustra/scripts/bench/pages/presets_file.py from accuracy.json; do not edit.",
    ]
    for name in PRESETS:
        found = _points(result, f"preset={name}")
        for what, (key, unit, scale, about) in _ENTRIES.items():
            errors = [point["error"] * scale for question, point in found.items() if question.endswith(what)]
            lines += _entry(f"{name}.{key}", errors, unit, _source(date, processor), about)
        speeds = [1 / point["cost"] for question, point in found.items() if question.endswith("tip path")]
        lines += _entry(f"{name}.real_time_factor", speeds, "1", _source(date, processor), "of physics alone, one core")
    return "\n".join(lines) + "\n"


def _points(result: Mapping[str, Any], setting: str) -> dict[str, dict[str, Any]]:
    return {
        front["question"]: point
        for front in result["fronts"]
        if front["question"].startswith("insertion")
        for point in front["points"]
        if point["setting"] == setting and point["outcome"] == "completed"
    }


def _source(date: str, processor: str) -> str:
    return f"measured by `haustra bench accuracy --questions insertion` on {date}, {processor}"


def _entry(name: str, values: list[float], unit: str, source: str, note: str) -> list[str]:
    if not values:
        return []

    def digits(value: float) -> float:
        return float(f"{value:.2g}") if math.isfinite(value) else value

    rounded = [digits(value) for value in values]
    return [
        "",
        f"[{name}]",
        f"value = {rounded[0]!r}",
        f'unit = "{unit}"',
        f"low = {min(rounded)!r}",
        f"high = {max(rounded)!r}",
        f'source = "{source}"',
        f'note = "{note}"',
    ]


if __name__ == "__main__":
    text = presets_toml(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
    print(write_atomically(asset("presets.toml"), lambda path: path.write_text(text, encoding="utf-8")))
