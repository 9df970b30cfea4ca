"""The leaderboard of insertions: what `haustra evaluate -o DIR` left, judged by the protocol, and the page of all.

`python -m haustra.scripts.bench.pages.leaderboard_page [DIR ...] docs/validation/leaderboard.md` adds what was measured
to data/leaderboard.json beside the page, where a driver takes the place of the one of its name and band, and writes the
page anew.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.errors import InvalidOptionError
from haustra.files import write_atomically, write_json
from haustra.reading import read_document

COLONS, EPISODES, SECONDS = 80, 5, 300.0
"""Held-out colons, episodes in each, and the longest of them [s]."""
_BANDS = {"any": [0.03, 0.1], "easy": [0.03, 0.05]}
"""Bands of difficulty, and the friction that belongs to each [1]."""
_TITLES = {"any": "Colons of any difficulty", "easy": "Easy colons"}
_COLUMNS = ("completion", "intubation", "progress", "safe_completion", "p_perforation", "pain", "peak_force_N")
_HEAD = f"""\
# Validation: leaderboard of insertions

**Question.** Who brings a scope to the caecum of a colon that nobody has trained in, and at what price?

Made from docs/validation/data/leaderboard.json by `python -m haustra.scripts.bench.pages.leaderboard_page`; do
not edit.

**Protocol.** {COLONS} grown colons from seed 100000 on, which no shipped training draws, on their mesentery;
{EPISODES} episodes of at most {SECONDS:g} s in each; friction from 0.03 to 0.1, or to 0.05 in the easy band,
wall and wires drawn by the episode's seed, the same for all; backend `linear-gpu`, or `linear`, the same
program on a CPU. A hand may be slower or weaker than the protocol's 40 N, never stronger. Nobody may read what
no device knows (`privileged`).
"""
_TAIL = """\
Means, with 95 % intervals by bootstrap over colons. *Completed*: the tip within 3 cm of the caecum's end.
*Valve*: past it, caecal intubation as guidelines count it. *Way*: mean share of the way. *Safe*: completed, and
no 6 cm of shaft ever pressed with more than 14.1 N. *P(perforation)*: share of people whose colon the largest
load would have torn, 0.016 to 0.2 % of patients. *Pain*: 1 where it is taken to begin ([injury](injury.md)); –
where it was not yet counted.

## Submit a policy

A policy is a folder of `policy.safetensors` and `policy.json`, layers and what they see; nothing in it is run.
Every training leaves one; `haustra.envs.learning.policy.save_policy` writes others. One command scores it, on
one GPU or, with `--backend linear`, in minutes on two CPU cores:

    haustra evaluate MY_POLICY --difficulty any --mesentery True --friction 0.03 0.1 \\
        --backend linear-gpu --no-video -o DIR

`python -m haustra.scripts.bench.pages.leaderboard_page DIR docs/validation/leaderboard.md` checks the protocol,
adds the row, and refuses what was measured otherwise. Send the folder of the policy, DIR and the row as a
change to the repository.

## What it does not say

- Nothing here was compared with patients; see [known limits](../limits.md).
- Rows are as old as their dates: physics that changed since is told in the repository's CHANGELOG.md.
- Policies are compared with their own hands and eyes: who sees an imager is told by its `policy.json`.
"""


def leaderboard_page(rows: list[dict[str, Any]]) -> str:
    """The page of all rows, the best first."""
    parts = [_HEAD]
    for band, friction in _BANDS.items():
        own = sorted((row for row in rows if row["difficulty"] == band), key=lambda row: -row["completion"])
        if not own:
            continue
        parts.append(f"\n## {_TITLES[band]}, friction {friction[0]:g} to {friction[1]:g}\n")
        names = ("driver", "completed", "valve", "way", "safe", "P(perforation)", "pain", "peak force", "device, date")
        parts += [f"| {' | '.join(names)} |", f"|{'---|' * len(names)}"]
        for row in own:
            cells = [_cell(row, name) for name in _COLUMNS]
            parts.append(f"| {row['driver']} | {' | '.join(cells)} | {row['device']}, {row['date']} |")
    return "\n".join([*parts, "", _TAIL])


def _cell(row: Mapping[str, Any], name: str) -> str:
    if name not in row:
        return "–"
    low, high = row[f"{name}_bootstrap"]
    digits, unit = (1, " N") if name.endswith("_N") else (3 if name != "pain" else 2, "")
    return f"{row[name]:.{digits}f} ({low:.{digits}f}–{high:.{digits}f}){unit}"


def rows_of(evaluation: Mapping[str, Any], source: str) -> list[dict[str, Any]]:
    """Rows of an evaluation.json, one a driver.

    Args:
        evaluation: what it says.
        source: what to call it when it is refused.

    Raises:
        InvalidOptionError: when it was not measured by the protocol.
    """
    task, made = evaluation["task"], evaluation["provenance"]
    band, backend = task["difficulty"], made["backend"]
    needed = {
        "task": task.get("task", "insertion") == "insertion",
        "difficulty": band in _BANDS,
        "friction": list(task["randomisation"]["friction"]) == _BANDS.get(band),
        "mesentery": task["mesentery"],
        "privileged": not task["privileged"],
        "seconds": task["limits"]["seconds"] == SECONDS,
        "hand_lead": task["drive"]["hand_lead"] <= 0.01,
        "backend": backend["backend"].startswith("linear"),
        "colons": made["configuration"]["colons"] == COLONS,
        "episodes": all(one["episodes"] == COLONS * EPISODES for one in evaluation["drivers"]),
    }
    if wrong := [name for name, kept in needed.items() if not kept]:
        raise InvalidOptionError(f"'{source}' was not measured by the protocol: {', '.join(wrong)} differ.")
    about = {"difficulty": band, "device": backend["device"].removeprefix("gpu "), "date": made["created"][:10]}
    kept = [*_COLUMNS, *(f"{name}_bootstrap" for name in _COLUMNS)]
    return [
        {"driver": Path(one["driver"]).name, **about, **{name: one[name] for name in kept if name in one}}
        for one in evaluation["drivers"]
    ]


def main(folders: list[str], page: Path) -> None:
    """Take what was measured in folders, and write file and page anew."""
    data = page.parent / "data" / "leaderboard.json"
    rows = read_document(data, "leaderboard")["rows"] if data.exists() else []
    for folder in folders:
        path = Path(folder) / "evaluation.json"
        new = rows_of(read_document(path, "evaluation"), str(path))
        known = {(row["driver"], row["difficulty"]) for row in new}
        rows = [row for row in rows if (row["driver"], row["difficulty"]) not in known] + new
    write_json(data, {"rows": rows})
    write_atomically(page, lambda temporary: temporary.write_text(leaderboard_page(rows), encoding="utf-8"))


if __name__ == "__main__":
    main(sys.argv[1:-1], Path(sys.argv[-1]))
