"""Every field of every configuration, inside its range and outside: it runs soundly, or is refused in one line.

No observation and no reward is NaN, and nothing ends in a traceback: an error that is not one of haustra's own fails
the test.
"""

import tomllib
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import run_insertion
from haustra.envs.sim.native import NativeEngine
from haustra.envs.study.credibility import ContextOfUse
from haustra.envs.study.trials import Trial
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.device_env import DeviceEnv
from haustra.envs.tasks.device_task import DeviceRules
from haustra.envs.tasks.navigation import NavigationEnv, observation_space
from haustra.errors import HaustraError, InvalidDesignError
from haustra.fields import Declaration, declared_fields, read_fields, require_declared
from haustra.models.devices.base import load_device
from haustra.models.devices.capsule.interface import Capsule
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.pages.fields_page import CONFIGURATIONS
from haustra.scripts.registry import VERBS, load_verb
from tests.hostile.drawing import inside, outside
from tests.task_bank import DESIGN, short_bank
from tests.tube_colon import straight_tube

PATIENT = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
FEW = settings(deadline=None, derandomize=True, database=None, suppress_health_check=PATIENT)
SLOW = settings(FEW, phases=[Phase.explicit, Phase.generate])
"""A case that takes seconds is not made smaller: that would take minutes."""
ANY = st.sampled_from(sorted(CONFIGURATIONS))
FILES = {ContextOfUse: "docs/examples/credibility/insertion-tubes.toml", Trial: "assets/trials/flaccid.toml"}
STEPS = 2


@cache
def devices() -> dict[type, Any]:
    """One of each kind."""
    found = map(load_device, ("adult", "capsule", "tracked", "vine", "inchworm"))
    return {ScopeDesign: named_design("adult")} | {type(device): device for device in found}


@cache
def base(kind: type) -> dict[str, Any]:
    """A configuration that runs, as a parsed file."""
    known = devices()
    if kind in FILES:
        more = {"points": [{"name": "x", "file": "x.md", "category": 3, "values": {"friction": 0.1}}]}
        table = tomllib.loads((Path(__file__).parents[2] / FILES[kind]).read_text(encoding="utf-8"))
        return table | (more if kind is ContextOfUse else {})
    variable = {"name": "x", "path": "design.diameter", "unit": "m", "nominal": 1.0, "low": 0.0, "high": 2.0}
    return asdict(known[kind]) if kind in known else variable if "nominal" in kind.__dataclass_fields__ else {}


def changed(table: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Copy of the table with another value at a path, whose `[]` is the first of a list."""
    head, _, rest = path.partition(".")
    name = head.removesuffix("[]")
    inner = table.get(name, {})
    if not rest:
        return {**table, name: value}
    if head.endswith("[]"):
        return {**table, name: [changed(inner[0], rest, value), *inner[1:]]}
    return {**table, name: changed(inner, rest, value)}


def refused_in_one_line(error: HaustraError) -> None:
    assert str(error).isprintable() and 10 < len(str(error)) < 1500


@cache
def listed(kind: type) -> list[tuple[str, Declaration]]:
    return [(path, declared) for path, declared, *_ in declared_fields(kind)]


@cache
def one_of(kind: type) -> st.SearchStrategy[tuple[str, Declaration]]:
    return st.sampled_from(listed(kind))


@settings(FEW, max_examples=250)
@given(st.data())
def test_a_value_outside_its_range_is_refused_by_its_path(data: st.DataObject) -> None:
    kind = CONFIGURATIONS[data.draw(ANY)]
    path, declared = data.draw(one_of(kind))
    value = data.draw(outside(declared))
    with pytest.raises(InvalidDesignError) as refusal:
        read_fields(kind, changed(base(kind), path, value), error=InvalidDesignError)
    refused_in_one_line(refusal.value)
    assert path.rpartition(".")[2] in str(refusal.value)


@settings(FEW, max_examples=250)
@given(st.data())
def test_a_value_inside_its_range_is_taken_or_refused_with_its_reason(data: st.DataObject) -> None:
    kind = CONFIGURATIONS[data.draw(ANY)]
    table = base(kind)
    for path, declared in data.draw(st.lists(one_of(kind), min_size=1, max_size=3)):
        table = changed(table, path, data.draw(inside(declared)))
    try:
        read_fields(kind, table)
    except HaustraError as error:
        refused_in_one_line(error)


@settings(FEW, max_examples=200)
@given(st.data())
def test_options_of_the_command_line(data: st.DataObject) -> None:
    verb = load_verb(data.draw(st.sampled_from(sorted(VERBS))))
    numbers = [(path, declared) for path, declared in listed(verb) if declared.unit]
    if not numbers:
        return
    path, declared = data.draw(st.sampled_from(numbers))
    good = data.draw(st.booleans())
    made = object.__new__(verb)  # whose required options do not matter here
    for name, entry in verb.__dataclass_fields__.items():
        object.__setattr__(made, name, entry.default)
    object.__setattr__(made, path, data.draw((inside if good else outside)(declared)))
    others = {name for name, other in listed(verb) if other is not declared}
    for name in others:
        object.__setattr__(made, name, data.draw(inside(dict(listed(verb))[name])))
    try:
        require_declared(made, name=lambda name: f"--{name}")
        assert good
    except HaustraError as error:
        assert not good and str(error).startswith(f"--{path}")
        refused_in_one_line(error)


def drawn(data: st.DataObject, kind: type, most: int, *, leave: tuple[str, ...] = ()) -> dict[str, Any]:
    """Some fields of a configuration, each inside its range."""
    table = base(kind)
    fields = [(path, declared) for path, declared in listed(kind) if path.partition(".")[0] not in leave]
    for path, declared in data.draw(st.lists(st.sampled_from(fields), min_size=1, max_size=most, unique_by=str)):
        table = changed(table, path, data.draw(inside(declared)))
    return table


@settings(SLOW, max_examples=45)
@given(st.data())
def test_an_episode_of_a_scope_is_sound(data: st.DataObject) -> None:
    table = drawn(data, TaskConfig, 4, leave=("task", "design", "seeds", "difficulty", "mesentery", "picture_size"))
    table = table | {"picture_size": data.draw(st.integers(8, 64))}  # the largest, 512, takes seconds
    if data.draw(st.booleans()):
        table = changed(table, "drive.control_interval", 0.005 * data.draw(st.integers(1, 20)))
    actions = data.draw(st.lists(st.lists(st.floats(-2, 2), min_size=4, max_size=4), min_size=1, max_size=STEPS))
    try:
        environment = NavigationEnv(table | {"design": DESIGN}, bank=short_bank())
    except HaustraError as error:
        refused_in_one_line(error)
        return
    space = observation_space(environment.config)
    assert space.contains(environment.reset(seed=data.draw(st.integers(0, 99)))[0])
    for action in actions:
        seen, reward, _, _, info = environment.step(np.array(action))
        assert space.contains(seen) and np.isfinite(reward)
        assert all(np.isfinite(value).all() for value in info.values())
    environment.close()


@settings(SLOW, max_examples=20)
@given(st.data())
def test_an_episode_of_any_device_is_sound(data: st.DataObject) -> None:
    try:
        capsule = read_fields(Capsule, drawn(data, Capsule, 3))
        rules = read_fields(DeviceRules, drawn(data, DeviceRules, 3, leave=("mesentery", "seeds")))
        rules = replace(rules, control_interval=0.005 * data.draw(st.integers(1, 20)))
        environment = DeviceEnv(capsule, colons=[straight_tube(0.3)], rules=rules)
    except HaustraError as error:
        refused_in_one_line(error)
        return
    seen, _ = environment.reset(seed=0)
    assert environment.observation_space.contains(seen)
    for _ in range(STEPS):
        seen, reward, *_ = environment.step(environment.action_space.sample())
        assert environment.observation_space.contains(seen) and np.isfinite(reward)


@settings(SLOW, max_examples=40)
@given(st.data())
def test_a_run_of_any_scope_ends_with_its_outcome(data: st.DataObject) -> None:
    scene = drawn(data, SceneOptions, 3, leave=("mesentery", "segment_stiffness", "wall_law"))
    try:
        design = read_fields(ScopeDesign, drawn(data, ScopeDesign, 2))
        settings = read_fields(FollowerSettings, drawn(data, FollowerSettings, 2))
        options = read_fields(SceneOptions, {"insertion_limit": 0.25, "wall_law": "planes"} | scene)
        options = replace(options, timestep=max(options.timestep, 1e-3))
        built = build_scene(straight_tube(0.3), None, design, options, show_lumen=False)
        run = run_insertion(built, seconds=0.1, settings=settings, backend=NativeEngine)
    except HaustraError as error:
        refused_in_one_line(error)
        return
    recorded = run.trajectory
    assert run.outcome.value == "diverged" or all(np.isfinite(value).all() for value in vars(recorded).values())
