"""Pages of cohorts: a table and a figure of every observable, inside or outside."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.study.clinic_pain import HURTS
from haustra.envs.study.cohort import OWN_DEVICE
from haustra.envs.study.cohort_causes import causes
from haustra.envs.study.cohort_table import GROUP, Observable, Published, observables, published, rows_of, verdicts
from haustra.envs.study.costs import costs
from haustra.envs.study.store import SweepStore
from haustra.files import write_atomically, write_json

_PASSED = 0.5
"""Colon passed from which on gathering is told of [m]; engineering choice."""
_RISKY = 0.002
"""P(perforation) from which on it is told where [1]: what clinics see at most."""
_INSIDE, _OUTSIDE, _BAND = "#2f6f8f", "#c2413b", "#d9dfe3"


def write_cohort(store: SweepStore, folder: Path, *, seconds: float | None = None) -> dict[str, Path]:
    """Write page, figure and numbers of a cohort.

    Args:
        store: of its patients.
        folder: for the three files.
        seconds: that the examinations took on the clock [s].

    Raises:
        OutputError: when the folder cannot be written.
    """
    page, figure, numbers = folder / "cohort.md", folder / "cohort.png", folder / "cohort.json"
    told = cohort_told(store, seconds=seconds)
    write_json(numbers, told)
    draw_cohort(figure, columns([told]))
    text = cohort_page([told], image=figure.name)
    write_atomically(page, lambda path: path.write_text(text, encoding="utf-8"))
    return {"page": page, "figure": figure, "numbers": numbers}


def cohort_told(store: SweepStore, *, seconds: float | None = None) -> dict[str, Any]:
    """All that a page says of a cohort, as JSON values.

    Args:
        store: of its patients.
        seconds: that the examinations took on the clock [s].
    """
    study = store.study
    return {
        "patients": study.sampler.count,
        "seconds": seconds,
        "costs": costs(store.folder),
        "longest": study.options["seconds"],
        "seed": study.sampler.seed,
        "study": study.hash,
        "jobs": store.counts(),
        "examiners": [
            _examiner(store, str(driver), str(device))
            for driver in study.conditions["driver"]
            for device in study.conditions["device"]
        ],
    }


def _examiner(store: SweepStore, driver: str, device: str) -> dict[str, Any]:
    own = {"driver": driver, "device": device}
    rows = rows_of(store, **own)
    found = observables(rows)
    moved = {
        about.name: [asdict(cause) for cause in causes(store, about, driver=driver, device=device)]
        for about, one in zip(published(), found, strict=True)
        if one.inside is False
    }
    told = {"observables": [one.to_json() for one in found], "causes": moved, "gathered": _gathered(store, own)}
    return own | told | _harm(rows)


def _harm(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """For how long each cause hurt a patient [s], and how far behind the tip walls were at risk [m]."""
    risky = [row for row in rows if row["p_perforation"] > _RISKY]
    return {
        "hurts": {cause: float(np.mean([row[f"pain_{cause}_s"] for row in rows])) for cause in HURTS} if rows else None,
        "risky": [float(row["load_from_tip_m"]) for row in risky],
    }


def _gathered(store: SweepStore, own: Mapping[str, str]) -> list[float] | None:
    """Least shaft inside over colon passed, past `_PASSED`: median and least over patients [1]."""
    shares = []
    for job in store.rows():
        curves = job["curves"]
        if (
            job["state"] == "finished"
            and curves
            and all(job["conditions"][name] == value for name, value in own.items())
        ):
            arc, shaft = (np.array(curves[name]) for name in ("tip_arc_m", "insertion_m"))
            far = arc > _PASSED
            shares += [float((shaft[far] / arc[far]).min())] if far.any() else []
    return [float(np.median(shares)), min(shares)] if shares else None


def columns(cohorts: Sequence[Mapping[str, Any]]) -> dict[str, list[Observable]]:
    """Observables of every driver and device of some cohorts, by what a column is named."""
    several = _several(cohorts)
    return {
        _named(cohort, examiner, several): [
            Observable(**{**one, "band": one["band"] and tuple(one["band"])}) for one in examiner["observables"]
        ]
        for cohort in cohorts
        for examiner in cohort["examiners"]
    }


def _several(cohorts: Sequence[Mapping[str, Any]]) -> bool:
    """Whether they are of patients of several seeds, which columns must tell apart."""
    return len({cohort["seed"] for cohort in cohorts}) > 1


def _named(cohort: Mapping[str, Any], examiner: Mapping[str, Any], several: bool) -> str:
    scope = "" if examiner["device"] == OWN_DEVICE else f", {examiner['device']}"
    return f"{Path(examiner['driver']).stem}{scope}" + (f", seed {cohort['seed']}" if several else "")


def cohort_page(cohorts: Sequence[Mapping[str, Any]], *, image: str, head: str = "# Cohort\n", most: int = 30) -> str:
    """The page as Markdown.

    Args:
        cohorts: as `cohort_told` gives them.
        image: place of the figure.
        head: what comes first.
        most: rows of the table of what moves observables of the first driver of the first cohort.
    """
    found, several = columns(cohorts), _several(cohorts)
    lines = [head]
    for cohort in cohorts:
        clock = "" if cohort["seconds"] is None else f" in {cohort['seconds']:.0f} s"
        parts = ", ".join(f"{part} {seconds:.0f} s" for part, seconds in cohort.get("costs", {}).items())
        clock += f" ({parts})" if parts else ""
        lines.append(
            f"Seed {cohort['seed']}: {cohort['patients']} patients, at most {cohort['longest']:g} s each{clock}; jobs: "
            f"{json.dumps(cohort['jobs'])}; study `{cohort['study'][:12]}`.\n"
        )
    for name, each in found.items():
        inside = verdicts(each)
        outside = ", ".join(name for name, within in inside.items() if not within) or "none"
        lines.append(f"**{name}**: {sum(inside.values())} of {len(inside)} observables inside. Outside: {outside}.\n")
    for cohort in cohorts:
        for examiner in cohort["examiners"]:
            if shares := examiner["gathered"]:
                lines.append(
                    f"{_named(cohort, examiner, several)}: past half a metre of colon, shaft inside over colon passed "
                    f"fell to {shares[0]:.2f} (median) and {shares[1]:.2f} (least).\n"
                )
            lines += _harm_told(_named(cohort, examiner, several), examiner)
    lines += [f"![Every observable against its band]({image})", ""]
    lines += [f"| observable | published | band | {' | '.join(found)} |", "|---" * (3 + len(found)) + "|"]
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
    return "\n".join(lines) + _causes_table(cohorts[0], several=several, most=most)


def _harm_told(name: str, examiner: Mapping[str, Any]) -> list[str]:
    """Lines on what hurt, and where walls were most at risk."""
    if not examiner["hurts"]:
        return []
    hurts = ", ".join(f"{cause.replace('_', ' ')} {seconds:.0f} s" for cause, seconds in examiner["hurts"].items())
    risky = np.array(examiner["risky"])
    where = (
        f" {len(risky)} patients bore more than P(perforation) = {_RISKY}, where the scope pressed most from "
        f"{risky.min():.2f} to {risky.max():.2f} m behind the tip (median {np.median(risky):.2f} m)."
        if len(risky)
        else f" Nobody bore more than P(perforation) = {_RISKY}."
    )
    return [f"{name}: what hurt a patient, and for how long on average: {hurts}.{where}\n"]


def _causes_table(cohort: Mapping[str, Any], *, several: bool, most: int) -> str:
    """What moves the observables that are outside, as Markdown; nothing where too few patients tell."""
    examiner = cohort["examiners"][0]
    lines = []
    for name, moved in examiner["causes"].items():
        for cause in moved:
            numbers = f"{cause['correlation']:+.2f} | {cause['patients']} | {cause['low']:.3g} | {cause['high']:.3g}"
            lines.append(f"| {name} | {cause['variable']} | {numbers} | {'yes' if cause['allowed'] else 'no'} |")
    if not lines:
        return ""
    return "\n".join(
        (
            f"\n## What moves those outside ({_named(cohort, examiner, several)})\n",
            "Rank correlation over patients with their numbers, the strongest three; means in the lowest and the",
            "highest third of the number, or of patients with and without a trait; and whether either third alone is",
            "inside, so that a value within the sourced range would do.\n",
            "| observable | number | correlation | patients | lowest third | highest third | inside somewhere |",
            "|---|---|---|---|---|---|---|",
            *lines[:most],
            "",
        )
    )


def _cell(one: Observable) -> str:
    if one.value is None:
        return "– (too few came so far)"
    said = "" if one.inside is None else " inside" if one.inside else " **outside**"
    return f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g}){said}"


def draw_cohort(path: Path, found: Mapping[str, Sequence[Observable]]) -> Path:
    """A small chart for each observable: its band, and each driver's value with interval."""
    import matplotlib.pyplot as plt

    listed = published()
    columns = 6
    rows = -(-len(listed) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(15.0, 2.5 * rows), layout="constrained")
    for index, (axis, about) in enumerate(zip(axes.flat, listed, strict=False)):
        _draw(axis, about, [(name, each[index]) for name, each in found.items()])
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
    labels = [name.replace(", ", "\n").replace("-", "-\n") for name, _ in found]
    axis.set_xticks(range(len(found)), labels, fontsize=min(7, 21 / len(found)))  # three stand beside each other at 7
    axis.set_xlim(-0.6, len(found) - 0.4)
    axis.set_title(f"{about.name.replace('_', ' ')} [{about.unit}]", fontsize=9)
