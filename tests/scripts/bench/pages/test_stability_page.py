"""The page on stability shows the limits that ship."""

import json
from pathlib import Path

from haustra.assets import asset

ROOT = Path(__file__).parents[4]
COLUMNS = ("implicitfast", "euler", "discrete", "rk4")


def test_the_largest_stable_steps_are_those_of_the_assets() -> None:
    page = (ROOT / "docs" / "validation" / "stability.md").read_text(encoding="utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.split("<!-- steps -->")[1].splitlines() if " ms |" in line]
    shown = {
        (row[0], row[1], name): cell.removeprefix("≥ ").removesuffix(" ms")
        for row in rows
        for name, cell in zip(COLUMNS, row[3:], strict=False)
    }
    limits = json.loads(asset("stability/steps.json").read_text(encoding="utf-8"))["limits"]
    assert len(limits) > 30
    for limit in limits:
        told = shown[limit["scene"], limit["preset"], limit["integrator"]]
        assert told == (f"{limit['limit_s'] * 1e3:.2g}" if limit["limit_s"] else "none"), limit
