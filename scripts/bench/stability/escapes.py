"""Ten thousand pushes: does a scope's tip ever leave the colon through the wall?"""

from pathlib import Path
from typing import Any

import numpy as np

from haustra.models.anatomy.store import load_colon
from haustra.provenance import content_hash
from haustra.scripts.bench.pushes import LARGEST_FORCE, LARGEST_SPEED, Push, Pushes, summary
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import prepare_colons
from haustra.scripts.bench.stability.rows import Answer, Row, Rows, fill

PUSHES, QUICK_PUSHES = 10_000, 60


def escapes(order: RunOptions, progress: Progress) -> Part:
    """Push a tip about in grown colon 0, and in another when one is given."""
    count = QUICK_PUSHES if order.quick else PUSHES
    prepare_colons(order.folder / "colons", 1, lambda seed: progress(0.0, "growing colon 0"), walls=False)
    colons = [order.folder / "colons" / "grown-0", *([order.colon] if order.colon else [])]
    criteria, found, done = [], [], 0
    for index, folder in enumerate(colons):
        name, pushes = _pushes(
            order, folder, count, lambda done, note, index=index: progress((index + done) / len(colons), note)
        )
        if not pushes:
            continue
        done += len(pushes)
        figures = summary(pushes)
        found.append({"colon": name, **figures})
        criteria.append(
            Criterion(f"escapes through tangent planes in {name}", figures["escaped"], 0, "pushes", "at most")
        )
    text = (
        f"A stiff tip of an adult scope, pushed from random places in random directions with up to {LARGEST_FORCE:g} N "
        f"and {LARGEST_SPEED:g} m/s against tangent planes; out is what stays more than 1 mm deeper than force over "
        "stiffness."
    )
    return Part(
        tuple(criteria),
        (Table("Pushes", tuple(found)),),
        summary=text,
        counts={"pushes": done},
        planned={"pushes": count * len(colons)},
    )


def _pushes(order: RunOptions, folder: Path, count: int, progress: Progress) -> tuple[str, tuple[Push, ...]]:
    colon = load_colon(folder)
    kept = order.folder / f"escapes-{content_hash(colon.lumen.vertices.tobytes())}.jsonl"
    rows = Rows(kept, {"seed": order.seed, "colon": colon.name})
    fill(
        rows, count, begin, (str(folder), order.seed), workers=order.workers, deadline=order.deadline, progress=progress
    )
    return colon.name, tuple(_push(row) for row in rows.first(count))


def begin(folder: str, seed: int) -> Answer:
    """What answers rows in one process."""
    rig = Pushes(load_colon(Path(folder)), None)

    def answer(number: int) -> Row:
        push = rig.push(np.random.default_rng([seed, number]))
        finite = {name: value if np.isfinite(value) else None for name, value in vars(push).items()}
        return {"number": number, "outcome": "escaped" if push.escaped else "", **finite}

    return answer


def _push(row: dict[str, Any]) -> Push:
    if row["outcome"] == "crashed":
        return Push(np.nan, np.nan, np.nan, np.inf, 0.0)
    return Push(
        **{
            name: np.inf if row[name] is None else row[name]
            for name in ("arc", "force", "travelled", "outside", "pressing")
        }
    )
