"""The page of what every field may hold is that of the code, and no number is undeclared."""

import typing
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

from haustra.envs.control.laws import DRIVERS
from haustra.fields import declaration_of, declared_fields
from haustra.models.scene import SceneOptions
from haustra.scripts.bench.pages.fields_page import CONFIGURATIONS, fields_page
from haustra.scripts.registry import VERBS, load_verb

FREE = {"nominal", "low", "high", "deviation", "values"}
"""Numbers of a study's variables, whose unit and range are those of what their path leads to."""


def test_the_committed_page_is_current() -> None:
    committed = Path(__file__).parents[4] / "docs" / "fields.md"
    assert committed.read_text(encoding="utf-8") == fields_page(), "run `make docs` and commit the page"


def test_settings_of_every_driver_that_a_file_may_name_are_listed() -> None:
    assert set(DRIVERS.values()) <= set(CONFIGURATIONS.values())


@pytest.mark.parametrize("kind", [*CONFIGURATIONS.values(), *map(load_verb, VERBS)], ids=lambda kind: kind.__name__)
def test_every_number_is_declared(kind: type) -> None:
    undeclared = [name for holder, name in _numbers(kind) if name not in FREE and not _is_declared(holder, name)]
    assert not undeclared


def test_defaults_are_within_their_ranges() -> None:
    for kind in (*CONFIGURATIONS.values(), *map(load_verb, VERBS)):
        for path, declared, default, _ in declared_fields(kind):
            if isinstance(default, int | float | tuple):
                assert not declared.wrong(default), f"{kind.__name__}.{path}"


@pytest.mark.parametrize(
    "name", ["friction", "wall_stiffness", "push_limit", "timestep", "largest_bend_deg", "gravity"]
)
def test_options_of_a_run_have_the_ranges_of_its_scene(name: str) -> None:
    assert declaration_of(load_verb("run"), name) == declaration_of(SceneOptions, name)


def _numbers(kind: type) -> Iterator[tuple[type, str]]:
    """Every field that holds a number, of a configuration and its parts."""
    for entry in fields(kind):
        hint = typing.get_type_hints(kind)[entry.name]
        inner = {hint, *typing.get_args(hint)}
        inner |= {deep for one in inner for deep in typing.get_args(one)}
        if inner & {int, float}:
            yield kind, entry.name
        for part in inner:
            if isinstance(part, type) and is_dataclass(part):
                yield from _numbers(part)


def _is_declared(kind: type, name: str) -> bool:
    try:
        return declaration_of(kind, name).unit is not None
    except KeyError:
        return False
