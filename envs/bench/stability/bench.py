"""All parts of the stability benchmark, or some, as one result."""

from collections.abc import Callable, Sequence

from haustra.envs.bench.machine import machine
from haustra.envs.bench.result import Bench
from haustra.envs.bench.stability.conservation import conservation
from haustra.envs.bench.stability.escapes import escapes
from haustra.envs.bench.stability.long import long_run
from haustra.envs.bench.stability.part import Order, Part, Progress
from haustra.envs.bench.stability.poison import poison
from haustra.envs.bench.stability.random_runs import random_runs
from haustra.envs.bench.stability.shocks import shocks
from haustra.errors import InvalidOptionError

PARTS: dict[str, Callable[[Order, Progress], Part]] = {
    "conservation": conservation,
    "nan": poison,
    "shocks": shocks,
    "escapes": escapes,
    "ranges": random_runs,
    "long": long_run,
}


def stability(order: Order, only: Sequence[str], progress: Callable[[str, float, str], None]) -> Bench:
    """Run parts one after the other; what is finished of long ones is kept in the order's folder.

    Args:
        order: where to, how much.
        only: names of parts; all when empty.
        progress: told the part, the share of it that is done, and a note.

    Raises:
        InvalidOptionError: when there is no such part.
    """
    if unknown := [name for name in only if name not in PARTS]:
        raise InvalidOptionError(f"Part '{unknown[0]}' is not known. Known: {', '.join(PARTS)}.")
    found = []
    for name in only or PARTS:
        found.append(PARTS[name](order, lambda done, note, name=name: progress(name, done, note)))
    extent = "Quick run: fewer and shorter." if order.quick else "Full run."
    return Bench(
        name="stability",
        title="Numerical stability",
        summary=(extent, *(part.summary for part in found if part.summary)),
        bars=tuple(bar for part in found for bar in part.bars),
        tables=tuple(table for part in found for table in part.tables),
        machine=machine(),
    )
