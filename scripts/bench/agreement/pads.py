"""A track of tread pads on a flat strip: its steady force, normal force and ripple on MuJoCo Warp and natively."""

from collections.abc import Mapping

from haustra.scripts.bench.agreement.row import Agreement

_QUESTIONS = {
    "force": ("force_apart", 1e-4, "single against double precision over 1500 steps of sliding contact"),
    "normal force": ("normal_apart", 1e-4, "the same"),
    "ripple": ("ripple_apart", 1e-3, "a small difference of large forces: a tenth of their accuracy"),
}
"""Which entry of a comparison answers, the tolerance and its reason."""
NO_TREADS = "steps scopes only"


def compare_pads(absent: Mapping[str, str], *, device: str | None = None) -> list[Agreement]:
    """The largest differences over four speeds and frictions.

    Args:
        absent: backends that cannot be asked, and why.
        device: as Warp names it.
    """
    questions = [
        Agreement(f"track of tread pads: {name}", "warp", tolerance, "of the native", reason)
        for name, (_, tolerance, reason) in _QUESTIONS.items()
    ]
    rows = [question.without(backend, why) for backend, why in absent.items() for question in questions[:1]]
    if "warp" in absent:
        return rows
    from dataclasses import replace

    from haustra.scripts.bench.rigs import compare_rigs

    found = compare_rigs("track", device)
    for question, (entry, _, _) in zip(questions, _QUESTIONS.values(), strict=True):
        rows.append(replace(question, difference=max((row[entry] for row in found), key=abs)))
    return rows
