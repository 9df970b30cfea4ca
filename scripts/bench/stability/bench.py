"""All parts of the stability benchmark, or some, as one result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from haustra.errors import InvalidOptionError
from haustra.scripts.bench.machine import machine
from haustra.scripts.bench.result import Bench, Criterion
from haustra.scripts.bench.stability.conservation import conservation
from haustra.scripts.bench.stability.escapes import escapes
from haustra.scripts.bench.stability.linear import linear
from haustra.scripts.bench.stability.long import long_run
from haustra.scripts.bench.stability.moving import moving
from haustra.scripts.bench.stability.nan_injection import inject
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import random_runs
from haustra.scripts.bench.stability.shocks import shocks
from haustra.scripts.bench.stability.step import largest_steps

PARTS: dict[str, Callable[[RunOptions, Progress], Part]] = {
    "conservation": conservation,
    "nan": inject,
    "shocks": shocks,
    "step": largest_steps,
    "escapes": escapes,
    "ranges": random_runs,
    "long": long_run,
    "moving": moving,
    "linear": linear,
}


def stability(
    order: RunOptions,
    only: Sequence[str],
    progress: Callable[[str, float, str], None],
    keep: Callable[[Bench], None] = lambda so_far: None,
) -> Bench:
    """Run parts one after the other; what is finished of long ones is kept in the order's folder.

    Args:
        order: where to, how much.
        only: names of parts; all when empty.
        progress: told the part, the share of it that is done, and a note.
        keep: given the result so far after each part.

    Raises:
        InvalidOptionError: when there is no such part.
    """
    if unknown := [name for name in only if name not in PARTS]:
        raise InvalidOptionError(f"Part '{unknown[0]}' is not known. Known: {', '.join(PARTS)}.")
    found: dict[str, Part] = {}
    for name in only or PARTS:
        found[name] = PARTS[name](order, lambda done, note, name=name: progress(name, done, note))
        keep(_result(order, found))
    return _result(order, found)


def _result(order: RunOptions, found: Mapping[str, Part]) -> Bench:
    extent = "Quick run: fewer and shorter." if order.quick else "Full run."
    short = [f"{name}: {part.unfinished}" for name, part in found.items() if part.unfinished]
    if short:
        extent += f" Not finished, and so far only {'; '.join(short)}: run the same again to go on."
    parts = found.values()
    return Bench(
        name="stability",
        title="Numerical stability",
        summary=(extent, *(part.summary for part in parts if part.summary)),
        criteria=tuple(_told(criterion, part) for part in parts for criterion in part.criteria),
        tables=tuple(table for part in parts for table in part.tables),
        machine=machine(),
    )


def _told(criterion: Criterion, part: Part) -> Criterion:
    """A criterion of a part that is not finished says so."""
    return replace(criterion, what=f"{criterion.what} (so far, {part.unfinished})") if part.unfinished else criterion
