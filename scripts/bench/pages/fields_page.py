"""Write the documentation page of every field of every configuration, and what it may hold.

`python -m haustra.scripts.bench.pages.fields_page docs/fields.md`.
"""

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import MISSING
from functools import cache
from pathlib import Path
from typing import Any

from haustra.envs.control.laws import DRIVERS
from haustra.envs.learning.settings import Training
from haustra.envs.study.credibility import ContextOfUse
from haustra.envs.study.device import DeviceStudyOptions
from haustra.envs.study.propulsion import PropulsionStudyOptions
from haustra.envs.study.scope import ScopeStudyOptions
from haustra.envs.study.study import Budget, Sampler, Variable
from haustra.envs.study.trials import Trial
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.device_task import DeviceRules
from haustra.fields import Declaration, declared_fields
from haustra.files import write_atomically
from haustra.models.devices.base import device_class, kinds
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import SceneOptions
from haustra.scripts.registry import VERBS, load_verb

CONFIGURATIONS: Mapping[str, type] = {
    "Episodes of scopes": TaskConfig,
    "Episodes of any device": DeviceRules,
    "Training": Training,
    "Scenes": SceneOptions,
    "Scope designs": ScopeDesign,
    **{f"Devices of kind '{kind}'": device_class(kind) for kind in kinds()},
    **{f"The driver '{name}'": settings for name, settings in DRIVERS.items()},
    "A study's variable": Variable,
    "A study's sampler": Sampler,
    "A study's budget": Budget,
    "A study of scopes": ScopeStudyOptions,
    "A study of any device": DeviceStudyOptions,
    "A study of propulsion": PropulsionStudyOptions,
    "A published trial": Trial,
    "A context of use": ContextOfUse,
}
"""Every configuration but the verbs', which `haustra.scripts.registry` lists."""

_HEAD = """\
# What every field may hold

Each configuration is a frozen dataclass whose fields declare unit and range (`haustra.fields`). Files in TOML, YAML and
JSON, keywords and options of the command line are checked alike; a value outside its range is refused in one line that
names path, value, range and unit. Ranges are engineering choices: wide enough for any device and episode that makes
sense, narrow enough to catch a wrong unit. Plausible values with their sources are on the page of
[numbers](numbers.md). This page is generated from the code by `make docs`.
"""


def fields_page() -> str:
    """The page as Markdown."""
    parts = [_HEAD, *(_section(title, kind, str) for title, kind in CONFIGURATIONS.items())]
    for name in VERBS:
        verb = load_verb(name)
        if any(declared.unit for _, declared, _, _ in declared_fields(verb)):
            parts.append(_section(f"`haustra {name}`", verb, _option))
    return "\n".join(parts)


def _option(path: str) -> str:
    return f"--{path.replace('_', '-')}"


def _section(title: str, kind: type, name: Any) -> str:
    head = f"## {title}\n\n| field | may be | default | |\n|---|---|---|---|\n"
    return head + "".join(
        f"| {name(path)} | {_cell(declared)} | {_default(default)} | {_about(holder, path)} |\n"
        for path, declared, default, holder in declared_fields(kind)
    )


def _cell(declared: Declaration) -> str:
    return str(declared).replace("|", "\\|")


def _default(value: Any) -> str:
    if value is MISSING:
        return "required"
    return "none" if value in (None, ()) else f"{value:.6g}" if isinstance(value, float) else _plain(value)


def _plain(value: Any) -> str:
    return ", ".join(map(_default, value)) if isinstance(value, tuple) else str(value)


def _about(holder: type, path: str) -> str:
    """First sentence of a field's docstring."""
    text = _docstrings(holder).get(path.rpartition(".")[2], "")
    return " ".join(text.split()).partition(". ")[0].rstrip(".").replace("|", "\\|")


@cache
def _docstrings(kind: type) -> dict[str, str]:
    """Docstrings of a class's fields, its bases' included, read from the source."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if base.__module__.startswith("haustra."):
            found |= dict(_own_docstrings(base))
    return found


def _own_docstrings(kind: type) -> Iterator[tuple[str, str]]:
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    assert isinstance(body, ast.ClassDef)
    for entry, after in zip(body.body, body.body[1:], strict=False):
        match entry, after:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str() as said)):
                yield name, said


if __name__ == "__main__":
    page = fields_page()
    write_atomically(Path(sys.argv[1]), lambda path: path.write_text(page, encoding="utf-8"))
