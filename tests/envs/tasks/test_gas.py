"""Gas in episodes: each world has its own, drivers see the lumen as wide as gas holds it, and scores say how much."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from haustra.envs.learning.evaluate import evaluate
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import PushDriver
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.gas.law import MMHG
from tests.task_bank import DESIGN, hung_bank, short_bank

CONFIG = TaskConfig(design=DESIGN, mesentery=True, gas=12 * MMHG, gas_start=12 * MMHG, limits=Limits(seconds=4.0))


def task_of(config: TaskConfig = CONFIG, **own: Any) -> ScopeTask:
    return ScopeTask(config, backend="linear", bank=hung_bank(), worlds=2, **own)


def test_drivers_see_a_lumen_as_wide_as_gas_holds_it():
    """At 12 mmHg narrower than as it was given, which is as at 25 mmHg."""
    seen = [
        task_of(config).reset(seeds=[0, 1], case=0)["lumen"]
        for config in (CONFIG, replace(CONFIG, gas=25 * MMHG, gas_start=3333.05), replace(CONFIG, gas=None))
    ]
    assert (seen[0].mean(axis=1) < 0.9 * seen[2].mean(axis=1)).all()
    np.testing.assert_allclose(seen[1], seen[2], atol=0.01)


def test_worlds_that_begin_anew_are_filled_anew():
    task = task_of()
    task.reset(seeds=[0, 1], case=0)
    gas = task.backend.gas
    assert gas is not None
    gas.asked = np.full(2, 5e-5)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(20):
        task.step(push)
    done = task.step(push)
    assert (done.info["gas_pressure_peak"] > 12.5 * MMHG).all() and (np.diff(done.info["gas_volume"]) == 0).all()
    gas.asked = np.full(2, np.nan)
    done = task.step(np.zeros((2, 4)), np.array([True, False]))
    assert done.info["gas_pressure_peak"][0] == pytest.approx(12 * MMHG, rel=0.02)
    assert done.info["gas_pressure_peak"][1] > 12.5 * MMHG
    assert done.info["gas_volume"][0] < done.info["gas_volume"][1]
    assert task.backend.read().time[0] == 0


def test_evaluations_say_pressure_and_volume_and_none_without_gas():
    found, usual = (
        evaluate(PushDriver, "push", config, hung_bank(), episodes=1, threads=1, backend="linear")
        for config in (CONFIG, replace(CONFIG, gas=None))
    )
    for one in found.episodes:
        assert 11.5 < float(one.gas_pressure_peak_mmHg or 0) < 13 and 20 < float(one.gas_volume_mL or 0) < 600
    assert usual.episodes[0].gas_volume_mL is usual.summary()["gas_pressure_peak_mmHg"] is None
    assert found.episodes[0].peak_force_N != usual.episodes[0].peak_force_N
    with pytest.raises(UnsupportedSceneError, match="record"):
        evaluate(PushDriver, "push", CONFIG, hung_bank(), backend="linear", record=True)


@pytest.mark.parametrize("backend", ["native", "linear-gpu"])
def test_other_backends_refuse_it_by_name(backend: str):
    with pytest.raises(UnsupportedSceneError, match=r"[Gg]as"):
        ScopeTask(CONFIG, backend=backend, bank=hung_bank())


def test_what_shows_colons_as_they_were_given_refuses_it():
    with pytest.raises(UnsupportedSceneError, match="as they were given"):
        task_of(replace(CONFIG, observation="depth"))
    with pytest.raises(UnsupportedSceneError, match="on_host"):
        task_of(on_host=True)
    with pytest.raises(UnsupportedSceneError, match="as they were given"):
        task_of().render(0, 16)
    with pytest.raises(InvalidOptionError, match="segments"):
        ScopeTask(replace(CONFIG, mesentery=False), backend="linear", bank=short_bank())
