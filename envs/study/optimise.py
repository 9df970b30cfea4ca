"""Looking for the best designs: Optuna proposes, the sweep's store remembers.

Designs are proposed in generations from what the store holds and nothing else, with a sampler that is seeded anew for
each: an optimisation that was killed proposes what it would have proposed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from haustra.envs.study.export import export, require_polars, results_frame
from haustra.envs.study.questions import find_backend
from haustra.envs.study.ranking import DesignTable, design_table, errors_of, ranked
from haustra.envs.study.run import DONE, Computing, Progress, answer_all, job_map
from haustra.envs.study.sampling import conditions_of, jobs_of, require_budget
from haustra.envs.study.store import SweepStore, open_store
from haustra.envs.study.study import Goal, Job, Study, Variable
from haustra.errors import InvalidStudyError, MissingDependencyError

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution

_STARTUP = 16
"""Designs drawn at random before any is proposed by what was learnt."""
_DIRECTIONS: dict[Goal, Literal["maximize", "minimize"]] = {"maximise": "maximize", "minimise": "minimize"}


def run_optimise(
    study: Study,
    folder: Path,
    computing: Computing | None = None,
    *,
    resume: bool = False,
    progress: Progress = lambda done, total, note: None,
) -> dict[str, object]:
    """Try `budget.trials` designs, each better informed by those before; the study's sampler gives the seed only.

    A design that fails or diverges under the first set of conditions is pruned: the others are not run. To the sampler
    a pruned design is worse than any other.

    Returns:
        Counts, the Pareto front, and the files written.

    Raises:
        InvalidStudyError: when there is nothing to vary, no objective, or the budget is too small.
        MissingDependencyError: without polars or Optuna.
    """
    computing = computing or Computing()
    require_polars()
    _require_optuna()
    backend = find_backend(study.question, computing.backend)
    if not study.variables or not study.objectives:
        raise InvalidStudyError("An optimisation needs [[variables]] to vary and [[objectives]] to reach.")
    trials, size = study.budget.trials, study.budget.generation
    require_budget(study, trials)
    with open_store(folder, study, lambda: (), kind="optimise", resume=resume) as store:
        with job_map(study, folder, computing, tell=lambda note: progress(0, 1, note)) as answer:
            store.begin_session(backend=computing.backend, pool=computing.on, alike=backend.alike)
            for first in range(0, trials, size):
                jobs = _generation(store, study, first, min(size, trials - first))
                for wave in (jobs[:: len(conditions_of(study))], jobs):
                    store.add(_unless_pruned(store, study, wave))
                    answer_all(store, answer, progress=lambda done, _, note, at=first: progress(at, trials, note))
        counts, table = store.counts(), table_of(store)
        return {
            "designs": len(table.designs),
            "pruned": int((~table.complete).sum()),
            **{state: counts[state] for state in DONE},
            "front": front_rows(table),
            **export(store),
        }


def table_of(store: SweepStore) -> DesignTable:
    """The objectives of the designs tried so far."""
    scores = list(dict.fromkeys(objective.score for objective in store.study.objectives))
    errors = errors_of(store.study, store.sessions())
    return design_table(results_frame(store), store.study, scores, errors=errors)


def front_rows(table: DesignTable) -> list[dict[str, float]]:
    """Designs on the Pareto front: number, rank (shared where they are not told apart), variables, mean objectives."""
    found = ranked(table)
    return [
        {
            "design": int(table.designs[place]),
            "rank": int(rank),
            **{name: float(values[place]) for name, values in table.variables.items()},
            **{o.score: float(table.means(o.score)[place]) for o in table.study.objectives},
        }
        for place, rank in zip(found.places[found.front], found.ranks[found.front], strict=True)
    ]


def _require_optuna() -> None:
    try:
        import optuna  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError("This needs Optuna: install it with 'pip install haustra[sweep]'.") from error


def _generation(store: SweepStore, study: Study, first: int, count: int) -> list[Job]:
    """All jobs of the next designs: those that are in the store already, or new proposals."""
    there = {row["design"]: row["variables"] for row in store.rows() if first <= row["design"] < first + count}
    designs = (
        [there[number] for number in sorted(there)] if len(there) == count else _propose(store, study, first, count)
    )
    return list(jobs_of(study, designs, first_design=first))


def _propose(store: SweepStore, study: Study, first: int, count: int) -> list[dict[str, float]]:
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    space = {variable.name: _distribution(variable) for variable in study.variables}
    seed = int(np.random.SeedSequence([study.sampler.seed, first]).generate_state(1)[0])
    search = optuna.create_study(
        directions=[_DIRECTIONS[objective.goal] for objective in study.objectives],
        sampler=optuna.samplers.TPESampler(seed=seed, n_startup_trials=_STARTUP),
    )
    table = table_of(store)
    values = np.stack([table.means(objective.score) for objective in study.objectives], axis=1)
    columns = {variable.name: table.variables[variable.column] for variable in study.variables}
    for place in np.flatnonzero(table.designs < first):
        done = bool(table.complete[place])
        search.add_trial(
            optuna.trial.create_trial(
                params={name: float(column[place]) for name, column in columns.items()},
                distributions=space,
                values=[float(value) for value in values[place]] if done else None,
                state=optuna.trial.TrialState.COMPLETE if done else optuna.trial.TrialState.PRUNED,
            )
        )
    asked = [search.ask(space) for _ in range(count)]
    return [{name: float(trial.params[name]) for name in space} for trial in asked]


def _distribution(variable: Variable) -> "BaseDistribution":
    from optuna.distributions import CategoricalDistribution, FloatDistribution

    if variable.distribution == "choice":
        return CategoricalDistribution(variable.values)
    return FloatDistribution(variable.low, variable.high, log=variable.distribution == "log-uniform")


def _unless_pruned(store: SweepStore, study: Study, jobs: Sequence[Job]) -> list[Job]:
    """Without the designs that have a job which failed or diverged."""
    pruned = {row["design"] for row in store.rows() if row["state"] in ("failed", "diverged")}
    return [job for job in jobs if job.design not in pruned]
