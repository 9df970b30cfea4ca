"""From a study to its designs and jobs."""

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from haustra.envs.study.study import Job, Study, Variable
from haustra.errors import InvalidStudyError


def designs_of(study: Study) -> list[dict[str, float]]:
    """Values of the variables of every design that the study's sampler asks for.

    Raises:
        InvalidStudyError: when they make more jobs than the budget allows.
    """
    sampler, names = study.sampler, [variable.name for variable in study.variables]
    require_budget(study, _count(study))
    if sampler.kind == "list":
        return [{name: float(design[name]) for name in names} for design in sampler.designs]
    if sampler.kind == "grid":
        grids = [variable.grid() for variable in study.variables]
        return [dict(zip(names, values, strict=True)) for values in itertools.product(*grids)]
    return at_quantiles(study.variables, _quantiles(study))


def _count(study: Study) -> int:
    if study.sampler.kind == "list":
        return len(study.sampler.designs)
    if study.sampler.kind == "grid":
        return int(np.prod([float(len(variable.grid())) for variable in study.variables]))
    return study.sampler.count


def require_budget(study: Study, designs: int) -> None:
    """Refuse more jobs than the study's budget allows.

    Raises:
        InvalidStudyError: when there are more.
    """
    jobs = designs * len(conditions_of(study))
    if jobs > study.budget.jobs:
        raise InvalidStudyError(
            f"{designs} designs under {len(conditions_of(study))} sets of conditions are {jobs} jobs, more than "
            f"budget.jobs = {study.budget.jobs}: raise it, or sample less."
        )


def at_quantiles(
    variables: Sequence[Variable], quantiles: Float[np.ndarray, "designs variables"]
) -> list[dict[str, float]]:
    """Designs at shares of each variable's distribution."""
    return [
        {variable.name: variable.at(float(share)) for variable, share in zip(variables, row, strict=True)}
        for row in quantiles
    ]


def _quantiles(study: Study) -> Float[np.ndarray, "designs variables"]:
    import warnings

    from scipy.stats import qmc

    sampler, size = study.sampler, len(study.variables)
    if sampler.kind == "latin-hypercube":
        return qmc.LatinHypercube(size, rng=sampler.seed).random(sampler.count)
    with warnings.catch_warnings():
        # It asks for powers of two, whose balance a user may give up.
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        return qmc.Sobol(size, rng=sampler.seed).random(sampler.count)


def conditions_of(study: Study) -> list[dict]:
    """Every combination of the study's conditions."""
    names = list(study.conditions)
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*study.conditions.values())]


def jobs_of(study: Study, designs: Sequence[Mapping[str, float]], *, first_design: int = 0) -> Iterator[Job]:
    """Every design under every set of conditions, numbered in that order."""
    conditions = conditions_of(study)
    for number, design in enumerate(designs, start=first_design):
        for place, condition in enumerate(conditions):
            yield Job(number * len(conditions) + place, number, dict(design), condition)


def design_names(study: Study) -> dict[int, str]:
    """Names of the designs that have one: those of a list."""
    return {number: str(design["name"]) for number, design in enumerate(study.sampler.designs)}
