"""Sentences that repeat a result elsewhere than on its own page say what the committed results say."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from haustra.envs.study.cohort_table import Observable, verdicts

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "validation" / "data"
WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")

SENTENCES = {
    "README.md": (
        "{inside} of {asked} figures of [published colonoscopies](docs/validation/cohort.md) in one cohort of "
        "{patients}",
        "{same} of {trials} [trials](docs/validation/trials.md) end as published",
        "{missed} of {differences} differences and {unequal} of {equalities} equalities of trials fail",
        "{linear:.0f} and {warp:.0f} % lower in colons that move, {fixed:.0f} % higher in fixed ones ({finer:.0f} % at "
        "2.5 ms)",
    ),
    "docs/index.md": (
        "Of {asked_word} observables",
        "a cohort of {patients} virtual patients reproduces [{inside_word}](validation/cohort.md)",
        "Of {trials_word} published comparisons of scopes [{same_word}](validation/trials.md) end as they did",
        "{told} of {differences} differences, {equal} of {equalities} equalities",
    ),
    "docs/validation.md": (
        "{told} of {differences}; {equal} of {equalities}",
        "and of published trials {failed_word} of {trials_word}",
        "{inside} of {asked} in {patients} patients",
    ),
    "docs/limits.md": (
        "A cohort of {patients} virtual patients matches {inside} of {asked} published observables",
        "Friction makes {friction:.2f} of the variance of how far the tip came, strength sideways {sideways:.2f}",
        "is {linear:.0f} % lower in linear time and {warp:.0f} % lower on `warp`",
    ),
    "docs/releases/0.2.0.md": (
        "holds in {inside} of {asked} figures in {patients} patients",
        "of {trials_word} published trials {same_word} end as published: {told} of {differences} differences and "
        "{equal} of {equalities} equalities",
    ),
}
"""What pages repeat, with places for the figures."""


def _result(name: str) -> Any:
    return json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))


def _trials() -> dict[str, int]:
    found = _result("trials")["trials"]
    different, alike = (
        [one["reproduced"] for one in found if one["trial"]["expected"] == kind] for kind in ("different", "equal")
    )
    (told, differences), (equal, equalities) = ((sum(each), len(each)) for each in (different, alike))
    return {
        "told": told,
        "differences": differences,
        "missed": differences - told,
        "equal": equal,
        "equalities": equalities,
        "unequal": equalities - equal,
        "same": told + equal,
        "failed": len(found) - told - equal,
        "trials": len(found),
    }


def _cohort() -> dict[str, int]:
    first = _result("cohort")["cohorts"][0]
    (own,) = [one for one in first["examiners"] if (one["driver"], one["device"]) == ("endoscopist", "adult")]
    found = verdicts([_observable(row) for row in own["observables"]])
    return {"inside": sum(found.values()), "asked": len(found), "patients": first["patients"]}


def _observable(row: Mapping[str, Any]) -> Observable:
    band = None if row["band"] is None else tuple(row["band"])
    return Observable(row["name"], row["value"], row["low"], row["high"], band, row["inside"])


def _torque() -> dict[str, float]:
    """Peak torque less than native in colons that move, and more in fixed ones, percent."""
    moving, fixed = (
        {
            (run["timestep"], row["backend"]): 100 * row["difference"]
            for run in _result("agreement")["runs"]
            for row in run["rows"]
            if row["quantity"].endswith(f"{kind}, mean over seeds: peak torque")
        }
        for kind in ("mesentery", "fixed")
    )
    of_moving = {"linear": -moving[0.005, "linear"], "warp": -moving[0.005, "warp"], "finer": -moving[0.0025, "linear"]}
    return of_moving | {"fixed": fixed[0.005, "warp"]}


def _causes() -> dict[str, float]:
    total = {(row["score"], row["variable"]): row["total"] for row in _result("injury-causes")["indices"]}
    return {"friction": total["reach", "friction"], "sideways": total["p_perforation", "strength_sideways_N"]}


@pytest.mark.parametrize("page", SENTENCES)
def test_pages_repeat_what_was_found(page: str) -> None:
    counts = _trials() | _cohort()
    words = {f"{name}_word": WORDS[count] for name, count in counts.items() if count < len(WORDS)}
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    said = [sentence.format(**counts, **words, **_torque(), **_causes()) for sentence in SENTENCES[page]]
    assert [sentence for sentence in said if sentence not in text] == []
