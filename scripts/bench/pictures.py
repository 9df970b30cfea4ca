"""Pictures of tip releases: motion beside the data's, and what larger time steps cost."""

from pathlib import Path

import numpy as np

from haustra.files import write_atomically
from haustra.scripts.bench.release import DEFAULT_STEP, ReleaseErrors, Scheme, release_errors
from haustra.scripts.bench.rod_data import RodData, RodRelease

_SCENE_STEPS = (0.0005, 0.001, 0.002, 0.004)
"""Time steps at which scenes' numerical damping is shown [s]."""


def release_pictures(folder: Path, data: RodData, *, joints: int) -> list[Path]:
    """Draw every release: tip displacement of cable and data above, error over time at several steps below.

    Args:
        folder: where PNG files are written.
        data: the rod.
        joints: bending joints of the cable.

    Raises:
        OutputError: when a file cannot be written.
    """
    written = []
    for release in data.releases:
        runs: list[tuple[str, ReleaseErrors]] = []
        step = min(DEFAULT_STEP, 0.9 * release.relaxation_time)
        schemes: list[tuple[float, Scheme]] = [
            (step, "second order"),
            *((each, "as in scenes") for each in _SCENE_STEPS),
        ]
        for step, scheme in schemes:
            found = release_errors(data.rod, release, joints, timestep=step, scheme=scheme)
            runs.append((f"{scheme}, {step * 1e3:.1f} ms", found))
        path = folder / (Path(release.file).stem + ".png")
        written.append(write_atomically(path, lambda to, release=release, runs=runs: _draw(to, data, release, runs)))
    return written


def _draw(path: Path, data: RodData, release: RodRelease, runs: list[tuple[str, ReleaseErrors]]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    FigureCanvasAgg(figure)
    motion, error = figure.subplots(2, 1, sharex=True)
    main = np.linalg.svd(release.tip - release.tip.mean(axis=0), full_matrices=False)[2][0]
    rest = release.tip[-1]
    motion.plot(release.time, (release.tip - rest) @ main / data.rod.length * 100, "k", linewidth=2.5, label="data")
    first = runs[0]
    motion.plot(first[1].time, (first[1].tip - rest) @ main / data.rod.length * 100, linewidth=1, label=first[0])
    motion.set_ylabel("tip along its main direction\n[% of length]")
    motion.legend(loc="upper right", fontsize=8)
    for label, run in runs:
        gap = np.linalg.norm(run.tip - release.tip, axis=1) / data.rod.length * 100
        error.semilogy(run.time, np.maximum(gap, 1e-4), linewidth=1, label=f"{label}: rms {run.tip_rms * 100:.3f} %")
    error.set_xlabel("time [s]")
    error.set_ylabel("tip error [% of length]")
    error.legend(loc="upper right", fontsize=8)
    figure.suptitle(f"{release.file}: tip release")
    figure.savefig(path, dpi=110)
