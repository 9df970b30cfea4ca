"""How much of a score's variance each variable makes: Sobol's indices, by SALib."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from haustra.envs.study.export import export, require_polars, results_frame
from haustra.envs.study.questions import find_backend, find_question
from haustra.envs.study.ranking import CONFIDENCE, design_table
from haustra.envs.study.run import DONE, Computing, Progress, answer_all, job_map
from haustra.envs.study.sampling import at_quantiles, jobs_of, require_budget
from haustra.envs.study.store import open_store
from haustra.envs.study.study import Study
from haustra.errors import InvalidStudyError, MissingDependencyError
from haustra.files import write_json

if TYPE_CHECKING:
    import polars

FILE = "sensitivity.json"
_RESAMPLES = 1000
_SAME = 1e-9
"""Relative spread below which a score counts as constant: it has no variance to share out."""


@dataclass(frozen=True)
class Index:
    """What one variable does to one score, with half the width of its 95 % confidence."""

    score: str
    variable: str
    first: float
    """Share of the variance that it makes alone, S1."""
    first_confidence: float
    total: float
    """Share that it makes alone and with others, ST."""
    total_confidence: float


def run_sensitivity(
    study: Study,
    folder: Path,
    computing: Computing | None = None,
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, note: None,
) -> dict[str, object]:
    """Run Saltelli's sample of `sampler.count` points, (variables + 2) designs each, and analyse it.

    Returns:
        Counts, the indices, the share of points left out, and the files written.

    Raises:
        InvalidStudyError: when there is nothing to vary, or the budget is too small.
        MissingDependencyError: without polars or SALib.
    """
    computing = computing or Computing()
    require_polars()
    require_salib()
    backend = find_backend(study.question, computing.backend)
    if not study.variables:
        raise InvalidStudyError("Sensitivity needs [[variables]] to vary.")
    count = study.sampler.count
    if count & (count - 1):
        raise InvalidStudyError(f"sampler.count is {count}: Sobol's indices need a power of two, such as 64 or 256.")
    require_budget(study, count * (len(study.variables) + 2))
    designs = at_quantiles(study.variables, saltelli(study))
    with open_store(folder, study, lambda: jobs_of(study, designs), kind="sensitivity", resume=resume) as store:
        with job_map(study, folder, computing, tell=lambda note: progress(0, 1, note)) as answer:
            store.begin_session(backend=computing.backend, pool=computing.on, alike=backend.alike)
            answer_all(store, answer, progress=progress)
        counts = store.counts()
        indices, left_out = sobol_indices(results_frame(store), study)
        found = [asdict(index) for index in indices]
        write_json(folder / FILE, {"confidence": CONFIDENCE, "points_left_out": left_out, "indices": found})
        return {
            **{state: counts[state] for state in DONE},
            "points_left_out": left_out,
            "indices": found,
            **export(store),
            "sensitivity": str(folder / FILE),
        }


def require_salib() -> None:
    """Say what to install.

    Raises:
        MissingDependencyError: without SALib.
    """
    try:
        import SALib  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError("This needs SALib: install it with 'pip install haustra[sweep]'.") from error


def saltelli(study: Study) -> Float[np.ndarray, "designs variables"]:
    """Shares of each variable's distribution: for each point A, A with each coordinate of B in turn, and B."""
    from SALib.sample import sobol

    return sobol.sample(_problem(study), study.sampler.count, calc_second_order=False, seed=study.sampler.seed)


def sobol_indices(frame: "polars.DataFrame", study: Study) -> tuple[list[Index], float]:
    """Indices of every score over the mean of the conditions, and the share of points left out.

    A point of which any design has no numbers under any condition is left out whole, which biases the indices towards
    designs that work: mind the share. Scores without variance have no indices.
    """
    from SALib.analyze import sobol

    names = [score.name for score in find_question(study.question).scores if score.unit != "text"]
    names = [name for name in names if not study.scores or name in study.scores]
    table, block = design_table(frame, study, names), len(study.variables) + 2
    found: list[Index] = []
    rows = table.complete[: len(table.designs) // block * block]
    sound = np.logical_and.reduce(np.reshape(rows, (-1, block)), axis=1)
    for name in names:
        values = table.means(name)[: len(sound) * block].reshape(-1, block)[sound].ravel()
        if len(values) < 2 * block or not np.isfinite(values).all() or _constant(values):
            continue
        indices = sobol.analyze(
            _problem(study),
            (values - values.mean()) / values.std(),
            calc_second_order=False,
            num_resamples=_RESAMPLES,
            conf_level=CONFIDENCE,
            seed=study.sampler.seed,
        )
        parts = [[float(value) for value in indices[key]] for key in ("S1", "S1_conf", "ST", "ST_conf")]
        found += [Index(name, variable.column, *each) for variable, *each in zip(study.variables, *parts, strict=True)]
    return found, float(1 - sound.mean()) if len(sound) else 1.0


def _constant(values: Float[np.ndarray, " n"]) -> bool:
    return bool(np.ptp(values) <= _SAME * np.abs(values).max())


def _problem(study: Study) -> dict:
    count = len(study.variables)
    return {"num_vars": count, "names": [v.name for v in study.variables], "bounds": [[0.0, 1.0]] * count}
