"""Write the documentation page of what each backend honours.

`python -m haustra.scripts.bench.pages.capabilities_page docs/decisions/capabilities.md`.
"""

import sys
from itertools import groupby
from pathlib import Path

from haustra.envs.sim.capabilities import BACKENDS, CAPABILITIES, TRACKED_ON, Capability
from haustra.envs.sim.device_worlds import NAMES
from haustra.files import write_atomically

_HEAD = """\
# What each backend honours

Every field of a scene's options, of the designs of scopes and of the tracked robot, and of a task. A backend refuses by
name what it cannot honour, so that no field is silently ignored: `tests/envs/sim/test_capabilities.py` and
`test_tracked_capabilities.py` beside it run each field on each backend. This page is generated from
`haustra.envs.sim.capabilities` by `make docs`; edit that table, not this page.
"""
_TITLES = {
    "scene": "Scene",
    "device": "Scene of any device",
    "design": "Scope design",
    "tracked": "Tracked design",
    "task": "Task",
    "randomisation": "Randomisation",
}


def capabilities_page() -> str:
    """The page as Markdown."""
    backends = "".join(f"- `{name}`: {about}\n" for name, about in BACKENDS.items())
    parts = [_HEAD, backends]
    for room, entries in groupby(sorted(CAPABILITIES, key=_room), key=_room):
        parts.append(_section(_TITLES[room], list(entries)))
    return "\n".join(parts)


def _room(entry: Capability) -> str:
    return entry.path.partition(".")[0]


def _section(title: str, entries: list[Capability]) -> str:
    head = f"## {title}\n\n| field | {' | '.join(BACKENDS)} | |\n|{'---|' * (len(BACKENDS) + 2)}\n"
    return head + "".join(
        f"| {entry.path} | {' | '.join(_cell(entry, backend) for backend in BACKENDS)} | {entry.about} |\n"
        for entry in entries
    )


def _cell(entry: Capability, backend: str) -> str:
    if entry.path.startswith(("task.", "randomisation.")) and backend == "native":
        return "no tasks"
    if entry.path.startswith("tracked."):
        return TRACKED_ON[backend]
    if entry.path.startswith("device.") and backend not in NAMES:
        return "scopes only"
    if backend not in entry.only:
        return "yes"
    return "only " + ", ".join(_value(value) for value in entry.only[backend])


def _value(value: object) -> str:
    return "none" if value == () else f"`{value}`"


if __name__ == "__main__":
    page = capabilities_page()
    write_atomically(Path(sys.argv[1]), lambda path: path.write_text(page, encoding="utf-8"))
