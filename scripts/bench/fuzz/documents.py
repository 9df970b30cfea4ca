"""Damaged configurations: devices, designs and studies in TOML, trainings and tasks in JSON."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from haustra.assets import asset, assets
from haustra.envs.learning.settings import SHIPPED as TRAININGS
from haustra.envs.learning.settings import Training
from haustra.envs.study.study_file import SHIPPED as STUDIES
from haustra.envs.study.study_file import load_study
from haustra.envs.tasks.config import TaskConfig
from haustra.models.devices.base import load_device
from haustra.models.devices.scope.files import design_text
from haustra.models.devices.scope.library import DESIGN_NAMES, named_design
from haustra.reading import read_document
from haustra.scripts.bench.fuzz.spoiling import spoil

KINDS = ("device", "scope", "study", "training", "task")
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])")
_STRANGE = (
    *("nan", "-inf", "NaN", "1e309", "-1e300", "1e-300", "0", "-0.0", "-1", "9" * 400, "9" * 5000),
    *("true", "null", "''", '"x"', '"' + "x" * 10_000 + '"', '"[/red]\\u001b[2J"', "0x10", "1_000", "1979-05-27"),
    *("[]", "{}", "[1, 2]", "[[[[1]]]]"),
)
"""What stands in place of a number; some is TOML, some JSON, some neither."""


def document(rng: np.random.Generator) -> tuple[str, str, bytes]:
    """Kind, suffix and content of a damaged configuration."""
    kind = str(rng.choice(KINDS))
    text = _text(kind, rng)
    for _ in range(int(rng.integers(1, 4))):
        text = _edit(text, rng)
    content = text.encode(errors="replace")
    suffix = "json" if kind in ("training", "task") else "toml"
    return kind, suffix, spoil(content, rng) if rng.random() < 0.3 else content


def read(kind: str, path: Path) -> object:
    """What the verbs do with such a file before anything long begins.

    Raises:
        HaustraError: when it is refused.
    """
    if kind in ("device", "scope"):
        return load_device(path)
    if kind == "study":
        return load_study(path)
    return (Training if kind == "training" else TaskConfig).from_json(read_document(path, kind))


def _text(kind: str, rng: np.random.Generator) -> str:
    def one(names: Any) -> Any:
        return list(names)[int(rng.integers(len(names)))]

    if kind == "device":
        return one(assets("devices", ".toml").values()).read_text(encoding="utf-8")
    if kind == "scope":
        return design_text(named_design(one(DESIGN_NAMES)))
    if kind == "study":
        return asset(f"studies/{one(STUDIES)}.toml").read_text(encoding="utf-8")
    if kind == "training":
        return asset(f"training/{one(TRAININGS)}.json").read_text(encoding="utf-8")
    return json.dumps(TaskConfig().to_json(), indent=1)


def _edit(text: str, rng: np.random.Generator) -> str:
    """One change of a person or a program that means well: a number, a line, a key, a nest."""
    kind, lines = int(rng.integers(7)), text.splitlines()
    at = int(rng.integers(max(len(lines), 1)))
    if kind <= 2:
        found = list(_NUMBER.finditer(text))
        if found:
            where = found[int(rng.integers(len(found)))]
            strange = str(rng.choice(_STRANGE)) if rng.random() < 0.7 else f"{10 ** rng.uniform(-30, 30):.3g}"
            return text[: where.start()] + strange + text[where.end() :]
    elif kind == 3:
        del lines[at : at + 1]
    elif kind == 4:
        lines[at:at] = lines[at : at + 1]
    elif kind == 5:
        lines.insert(at, "x = " + "[" * int(rng.choice([3, 40, 3000])) + "1")
    else:
        word = rng.choice(re.findall(r"[A-Za-z_]{3,}", text) or ["x"])
        return text.replace(str(word), str(rng.choice(["", "x", "nan", "ü²", "a.b.c", "__class__", "../../etc"])), 1)
    return "\n".join(lines)
