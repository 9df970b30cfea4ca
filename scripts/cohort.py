"""`haustra cohort`: examine virtual patients, and hold what that shows against published colonoscopies."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class Cohort:
    """Examine a cohort of virtual patients, and hold what that shows against published colonoscopies."""

    name: Annotated[Literal["quick", "full"], tyro.conf.Positional]
    """quick: 24 patients, at most 10 min each; full: 400, at most 16 min each."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the cohort's patients and results."""
    driver: tuple[str, ...] = ("endoscopist",)
    """Who examines them: endoscopist, follower, TOML files of settings (`law`, and what differs from the usual), names
    of policies that ship, or folders of policies. Each sees the same patients. The first is held against the clinic."""
    device: tuple[str, ...] = ("own",)
    """Scopes by name or file, or own: the adult one, or what a policy was trained with. Each sees the same patients.
    The first is held against the clinic."""
    patients: int | None = whole(1, 1_000_000, default=None)
    """Number of patients; that of the cohort named when not given."""
    seconds: float | None = number("s", 1.0, 3600.0, default=None)
    """Longest examination [s]; that of the cohort named when not given."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of the Latin hypercube that patients are drawn by."""
    rooted: bool = True
    """Let mesenteries hang from their roots; otherwise from where colons were imaged."""
    resume: bool = False
    """Go on with what the folder holds."""
    backend: Literal["linear", "linear-gpu"] = "linear"
    """What steps the patients: every core, or an NVIDIA GPU."""
    report: bool = True
    """Write cohort.md, cohort.png and cohort.json at the end."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Examine all patients and compare."""
        import time

        from haustra.children import cores
        from haustra.envs.study.cohort import cohort_study
        from haustra.envs.study.cohort_table import observables, rows_of, verdicts
        from haustra.envs.study.costs import costs
        from haustra.envs.study.run import Computing, run_sweep
        from haustra.envs.study.store import read_store
        from haustra.scripts.console import progress_bar

        asked = {"drivers": self.driver, "devices": self.device, "patients": self.patients, "seconds": self.seconds}
        study = cohort_study(self.name, **asked, seed=self.seed, rooted=self.rooted)
        began = time.monotonic()
        with progress_bar(study.title, 1, unit="patients") as advance:
            run_sweep(
                study,
                self.output,
                Computing(backend=self.backend, workers=cores()),
                resume=self.resume,
                tables=False,
                progress=lambda done, total, note: advance(done, note, total),
            )
        seconds = time.monotonic() - began
        with read_store(self.output) as store:
            found = observables(rows_of(store, driver=self.driver[0], device=self.device[0]))
            files = self._report(store, seconds) if self.report else {}
        spent = {f"{part}_seconds": each for part, each in costs(self.output).items()}
        result = {"patients": study.sampler.count, "seconds": seconds, **spent}
        result["observables"] = [one.to_json() for one in found]
        if self.json:
            return result
        inside = verdicts(found)
        lines = {one.name: _line(one) for one in found}
        return {**result, "observables": lines, "inside": f"{sum(inside.values())} of {len(inside)}", **files}

    def _report(self, store: Any, seconds: float) -> dict[str, str]:
        from haustra.envs.view.report.cohort_report import write_cohort

        return {name: str(path) for name, path in write_cohort(store, self.output, seconds=seconds).items()}


def _line(one: Any) -> str:
    if one.value is None:
        return "too few patients came so far"
    judged = "" if one.inside is None else ", inside" if one.inside else ", OUTSIDE"
    band = "" if one.band is None else f"; band {one.band[0]:g} to {one.band[1]:g}{judged}"
    return f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g}){band}"
