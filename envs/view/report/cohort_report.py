"""A cohort's page: a table and a figure of every observable, inside or outside."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from haustra.envs.study.cohort_causes import causes
from haustra.envs.study.cohort_table import GROUP, Observable, Published, observables, published, rows_of, verdicts
from haustra.envs.study.store import SweepStore
from haustra.files import write_atomically, write_json

_INSIDE, _OUTSIDE, _BAND = "#2f6f8f", "#c2413b", "#d9dfe3"


def write_cohort(store: SweepStore, folder: Path, *, seconds: float | None = None) -> dict[str, Path]:
    """Write page, figure and numbers of a cohort.

    Raises:
        OutputError: when the folder cannot be written.
    """
    found = {
        (str(driver), str(device)): observables(rows_of(store, driver=str(driver), device=str(device)))
        for driver in store.study.conditions["driver"]
        for device in store.study.conditions["device"]
    }
    page, figure, numbers = folder / "cohort.md", folder / "cohort.png", folder / "cohort.json"
    draw_cohort(figure, found)
    counts = store.counts()
    about = {
        "patients": store.study.sampler.count,
        "seconds": seconds,
        "study": store.study.hash,
        "jobs": counts,
        "found": {" ".join(key): [one.to_json() for one in each] for key, each in found.items()},
    }
    write_json(numbers, about)
    driver, device = next(iter(found))
    text = cohort_page(found, about, image=figure.name)
    text += causes_table(store, found[driver, device], driver=driver, device=device)
    write_atomically(page, lambda path: path.write_text(text, encoding="utf-8"))
    return {"page": page, "figure": figure, "numbers": numbers}


def cohort_page(
    found: Mapping[tuple[str, str], Sequence[Observable]], about: Mapping, *, image: str, head: str = "# Cohort\n"
) -> str:
    """The page as Markdown."""
    names = [f"{driver}, {device}" for driver, device in found]
    lines = [head, f"{about['patients']} patients; jobs: {json.dumps(about['jobs'])}; study `{about['study'][:12]}`."]
    for (driver, device), each in found.items():
        inside = verdicts(each)
        outside = ", ".join(name for name, within in inside.items() if not within) or "none"
        lines.append(
            f"\n**{driver}, {device}**: {sum(inside.values())} of {len(inside)} observables inside. Outside: {outside}."
        )
    lines += ["", f"![Every observable against its band]({image})", ""]
    lines += [f"| observable | published | band | {' | '.join(names)} |", "|---" * (3 + len(names)) + "|"]
    for index, one in enumerate(published()):
        band = "reported" if one.band is None else f"{one.band[0]:g} to {one.band[1]:g}"
        cells = " | ".join(_cell(each[index]) for each in found.values())
        lines.append(f"| {one.meaning} ({one.unit}) | {one.published} | {band} | {cells} |")
    lines += [
        "",
        "In brackets 95 % intervals over patients: Wilson's of shares, bootstrap of the others; peaks are the largest",
        f"of {GROUP} patients drawn from the cohort, as many as the published study had. Forces are read at 10 Hz,",
        "loops at 0.5 Hz. Bands are the published studies' own intervals; sources:",
        "",
        *(f"- {one.name}: {one.source}" for one in published()),
        "",
    ]
    return "\n".join(lines)


def causes_table(store: SweepStore, found: Sequence[Observable], *, driver: str, device: str) -> str:
    """What moves the observables that are outside, as Markdown; nothing where too few patients tell."""
    lines = []
    for about, one in zip(published(), found, strict=True):
        if one.inside is not False:
            continue
        for cause in causes(store, about, driver=driver, device=device):
            said = "yes" if cause.allowed else "no"
            numbers = f"{cause.correlation:+.2f} | {cause.low:.3g} | {cause.high:.3g} | {said}"
            lines.append(f"| {about.name} | {cause.variable} | {numbers} |")
    if not lines:
        return ""
    return "\n".join(
        (
            f"\n## What moves those outside ({driver}, {device})\n",
            "Rank correlation over patients with their numbers, the strongest three; means in the lowest and the",
            "highest third of the number, or of patients with and without a trait; and whether either third alone is",
            "inside, so that a value within the sourced range would do.\n",
            "| observable | number | correlation | lowest third | highest third | inside somewhere |",
            "|---|---|---|---|---|---|",
            *lines,
            "",
        )
    )


def _cell(one: Observable) -> str:
    if one.value is None:
        return "– (too few came so far)"
    said = "" if one.inside is None else " inside" if one.inside else " **outside**"
    return f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g}){said}"


def draw_cohort(path: Path, found: Mapping[tuple[str, str], Sequence[Observable]]) -> Path:
    """A small chart for each observable: its band, and each driver's and device's value with interval."""
    import matplotlib.pyplot as plt

    listed = published()
    columns = 6
    rows = -(-len(listed) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(15.0, 2.5 * rows), layout="constrained")
    for index, (axis, about) in enumerate(zip(axes.flat, listed, strict=False)):
        _draw(axis, about, [(driver, each[index]) for (driver, _), each in found.items()])
    for axis in axes.flat[len(listed) :]:
        axis.set_visible(False)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=100, format="png"))
    plt.close(figure)
    return path


def _draw(axis, about: Published, found: Sequence[tuple[str, Observable]]) -> None:
    if about.band is not None:
        axis.axhspan(*about.band, color=_BAND)
    for place, (_, one) in enumerate(found):
        if one.value is None or one.low is None or one.high is None:
            axis.text(place, 0.5, "too few", transform=axis.get_xaxis_transform(), ha="center", fontsize=8)
            continue
        colour = "#30343b" if one.inside is None else _INSIDE if one.inside else _OUTSIDE
        span = np.abs([[one.value - one.low], [one.high - one.value]])
        axis.errorbar([place], [one.value], yerr=span, fmt="o", color=colour, capsize=3)
    axis.set_xticks(range(len(found)), [driver for driver, _ in found], fontsize=8)
    axis.set_xlim(-0.6, len(found) - 0.4)
    axis.set_title(f"{about.name.replace('_', ' ')} [{about.unit}]", fontsize=9)
