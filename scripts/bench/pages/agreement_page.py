"""Write the page of the backends against each other from what `haustra bench agreement -o DIR` leaves.

`python -m haustra.scripts.bench.pages.agreement_page docs/validation/agreement.md DIR/agreement.json…`.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.files import write_atomically, write_json
from haustra.reading import read_document

_HEAD = """\
# The backends against each other

**Claim.** Native MuJoCo, linear time and MuJoCo Warp give the same answers: free scopes to rounding, whole insertions
in the mean within 3 %, with their whole 95 % intervals. {verdict}
What differs there is the error of native steps so long, as steps of 2.5 ms show.

Made by `python -m haustra.scripts.bench.pages.agreement_page docs/validation/agreement.md DIR/agreement.json…` after
the commands below, and kept in docs/validation/data/agreement.json; edit the script, not this page.
"""
_INSERTIONS = """
## Insertions

Each seed has a colon of its own of those grown, friction, stiffness of wall and shaft, wires and angle at the start,
{seconds:g} s, one lumen follower. Mean of the differences from native seed by seed, as a share of the native mean;
perforations as they are, of 100.
"""
_NOTES = """
## What it tells

- **Peak torque is what steps of 5 ms change.** In colons on the mesentery, in one of the eight, the tip sticks at a
  fold 0.4 m in, lets go some time after 14 s and comes 0.1 m further in half a second; the largest torque comes behind
  that, and depends on when it let go. Native steps of 5 ms stand alone: there linear time and Warp differ from native
  alike, by -7 and -5 % on the mesentery and +2.2 and +2.1 % in fixed colons, and at 2.5 ms from native by 1 % at most,
  where Warp was not run in fixed colons.
  At 5 ms, 256 seeds tell the torque in fixed colons to 3.3 % only, so there are 1,024.
- **Native batches solve contacts to 10⁻⁸** since 26 November 2026; at 10⁻⁵, as before, two of five such seeds let go at
  another time, for 4 % less processor time.
- **Lost worlds.** A run that diverged is named, and left out of its rows. MuJoCo Warp lost 36 of 1,024 runs in fixed
  colons on 23 November 2026: its Newton method factorises M + JᵀDJ in single precision, and with the scope's light
  hinges and friction that is 333 times as stiff as the wall the condition is 5·10⁷ to 1.5·10⁸ (20 states, in double
  precision), beyond 1/ε = 1.7·10⁷. Such a step has since been made again by conjugate gradients, which factorise M
  alone: of 13 states lost within four steps none is (`tests/envs/sim/test_warp_planes.py`), and of 1,024 runs none.
- **What it took.** Before, native batches gave the last sphere's arc length and its radius for the tip's own, 1.5 to
  3.4 mm too much (`tests/envs/sim/test_native_batch.py`), MuJoCo's friction gave way to loads
  ([contact law](../decisions/contact.md)), and native batches judged by the step before the last how fast a moving wall
  was pressed (`tests/envs/sim/test_moving_native.py`).
- Free scopes are 0.3 m long and take 1,000 steps of 5 ms; native is in double precision on the CPU, Warp on a GPU and
  linear time on the CPU in single precision.
"""


def agreement_page(kept: Mapping[str, Any]) -> str:
    """The page of {"runs": documents of agreement.json}."""
    runs = kept["runs"]
    apart = [
        f"{row['quantity'].split(': ')[1]} at steps of {1e3 * run['timestep']:g} ms"
        for run in runs
        for row in run["rows"]
        if row["agrees"] is False
    ]
    verdict = f"**Not in {len(apart)} rows below: {', '.join(dict.fromkeys(apart))}.**" if apart else "All are."
    parts = [_HEAD.format(verdict=verdict)]
    free = [row for row in _rows(runs) if not row["quantity"].startswith("insertion")]
    if free:
        lines = [
            f"| {row['quantity']} | {row['backend']} | {row['difference']:.1e} | {_limit(row)} | {_said(row)} |"
            for row in free
            if row["difference"] is not None
        ]
        parts.append("\n## Without a wall\n")
        parts.append(_table("| quantity | backend | difference | tolerance | within? |", lines))
    parts.append(_INSERTIONS.format(seconds=runs[0]["seconds"]))
    for run in runs:
        parts.append(_run(run))
    return "\n".join(parts) + _NOTES


def _run(run: Mapping[str, Any]) -> str:
    rows = [row for row in run["rows"] if row["quantity"].startswith("insertion") and row["difference"] is not None]
    where, step = run["machine"], 1e3 * run["timestep"]
    head = f"\n### Colons {_kind(rows[0])}, steps of {step:g} ms, {run['seeds']} seeds, {run['colons']} colons\n\n"
    told = f"{where['date']}, {where['cores']} cores, {where['processor'].replace('(R)', '')}"
    if any(row["backend"] == "warp" for row in rows):
        told += f", Warp {where['warp']} on {where['warp_device']}"
    if "remark" in run:
        told += f"; {run['remark']}"
    lines = [
        f"| {row['quantity'].split(': ')[1]} | {row['backend']} | {_percent(row)} | {row['cases']} | {_said(row)} |"
        for row in rows
    ]
    return f"{head}`{run['command']}`; {told}.\n\n" + _table(
        "| score | backend | difference (95 %) | seeds on both | within 3 %? |", lines
    )


def _kind(row: Mapping[str, Any]) -> str:
    return "on the mesentery" if "on the mesentery" in row["quantity"] else "fixed in space"


def _percent(row: Mapping[str, Any]) -> str:
    unit = " of 100" if row["unit"] == "of all" else " %"
    value, (low, high) = 100 * row["difference"], (100 * each for each in row["interval"])
    return f"{value:+.1f}{unit} ({low:+.1f} to {high:+.1f})"


def _rows(runs: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return [row for run in runs for row in run["rows"]]


def _limit(row: Mapping[str, Any]) -> str:
    return f"{row['tolerance']:g} {row['unit']}"


def _said(row: Mapping[str, Any]) -> str:
    return "yes" if row["agrees"] else "**no**"


def _table(head: str, lines: Iterable[str]) -> str:
    columns = head.count("|") - 1
    return "\n".join([head, "|" + "---|" * columns, *lines, ""])


def main(arguments: Sequence[str]) -> None:
    """Write the page, and what it is made from beside it."""
    page, *measured = map(Path, arguments)
    kept = {"runs": [read_document(each) for each in measured]}
    write_json(page.parent / "data" / f"{page.stem}.json", kept)
    write_atomically(page, lambda place: place.write_text(agreement_page(kept), encoding="utf-8"))


if __name__ == "__main__":
    main(sys.argv[1:])
