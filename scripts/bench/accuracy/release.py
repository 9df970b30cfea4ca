"""Question: how far is the cable from published motions of a rod that was let go?"""

import numpy as np

from haustra.errors import HaustraError
from haustra.models.devices.scope.rods import UniformRod
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, timed_front
from haustra.scripts.bench.release import Scheme, release_errors
from haustra.scripts.bench.rod_data import RodRelease, load_rod_data


def answer(effort: Effort) -> Answer:
    """Sweep joints, time step and scheme on the first release, ten seconds each; three releases when not quick."""
    if effort.rods is None:
        return Answer(notes=["Tip releases: not run, since no folder of rods was named (--rods)."])
    data = load_rod_data(effort.rods)
    fronts = []
    for release in data.releases[: 1 if effort.quick else 3]:
        effort.tell(f"tip release {release.file}")
        fronts.append(_front(data.rod, release, quick=effort.quick))
    return Answer(fronts)


def _front(rod: UniformRod, release: RodRelease, *, quick: bool):
    settings: list[tuple[str, int, float | None, Scheme]] = [
        *(("joints", count, None, "second order") for count in ((12, 25) if quick else (6, 12, 25, 50))),
        *(("timestep", 25, step, "second order") for step in (1e-3, 2e-3)),
        *(("as in scenes", 25, step, "as in scenes") for step in (1e-3, 3e-3, 5e-3)),
    ]
    candidates = []
    for group, joints, step, scheme in settings:
        setting = f"joints={joints}, timestep={step or 'largest, at most 0.003'}, scheme={scheme}"
        try:
            found = release_errors(rod, release, joints, timestep=step, scheme=scheme)
        except HaustraError:
            candidates.append(Candidate(setting, np.inf, group, None, "diverged"))
            continue

        def block(joints: int = joints, step: float | None = step, scheme: Scheme = scheme) -> float:
            return 1 / release_errors(rod, release, joints, timestep=step, scheme=scheme).real_time_factor

        candidates.append(Candidate(setting, found.tip_rms, group, block))
    return timed_front(
        f"tip release {release.file}",
        candidates,
        reference="data of OpenCR-MuJoCo (SoroSim); their own floor is 3e-4",
        error_unit="rms tip gap / L over 10 s",
        repeats=1 if quick else 3,
    )
