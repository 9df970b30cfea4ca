"""Bleeding in episodes: by the law of runs and drives, each world's own, and refused where nobody would be told."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from haustra.envs.runs.measure.injury import at_stations
from haustra.envs.tasks.config import Limits, Randomisation, TaskConfig
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import UnsupportedSceneError
from haustra.models.gas.law import MMHG
from haustra.models.injury.bleeding import bleeds, mucosal_shear
from haustra.models.injury.numbers import injury_number
from tests.task_bank import DESIGN, moving_bank, short_bank

ROUGH = Randomisation(friction=(1.5, 2.0))
CONFIG = TaskConfig(design=DESIGN, bleeding=True, limits=Limits(seconds=4.0), randomisation=ROUGH)
SUCKING = replace(
    CONFIG, mesentery=True, gas=12 * MMHG, gas_start=12 * MMHG, gas_action=True, randomisation=Randomisation()
)


@pytest.mark.parametrize("backend", ["linear", "native"])
def test_places_bleed_that_are_sheared_too_much(backend: str) -> None:
    """Counted once each, as the law says of what is read at each action's end; a world that begins anew has none."""
    task = ScopeTask(CONFIG, backend=backend, bank=short_bank(), worlds=2)
    task.reset(seeds=[0, 1], case=0)
    sheared, done = np.zeros((2, 200), bool), None
    for _ in range(60):
        done = task.step(np.tile([1.0, 0.3, 0.6, 0.0], (2, 1)))
        seen, lengths = task.seen, -np.diff(task.bank.scene.cable.node_distances)
        forces = np.where(seen.link_arcs > 0, seen.link_forces, 0.0)
        shear = mucosal_shear(forces, task.friction[:, None], task.bank.design.diameter, lengths)
        sheared |= np.asarray(bleeds(at_stations(shear, seen.link_arcs, 200)), bool)
    assert done is not None and (done.info["bleeding_places"] > 0).all()
    np.testing.assert_array_equal(done.info["bleeding_places"], sheared.sum(axis=1))
    assert (done.info["bleeding_pulled"] == 0).all() and (done.info["suction_pull"] == 0).all()
    again = task.step(np.zeros((2, 4)), np.array([True, False])).info["bleeding_places"]
    assert again[0] == 0 and again[1] >= done.info["bleeding_places"][1]
    assert (
        "bleeding_places" not in ScopeTask(replace(CONFIG, bleeding=False), backend=backend, bank=short_bank()).info()
    )


def test_suction_bleeds_where_the_wall_lies_over_the_channel() -> None:
    """A tip that is bent into the wall, sucking in full or by a fifth: 60 or 12 kPa below the atmosphere."""
    task = ScopeTask(SUCKING, backend="linear", bank=moving_bank(), worlds=2)
    task.reset(seeds=[0, 1], case=0)
    pulls, done = [], None
    for _ in range(60):
        done = task.step(np.array([[1.0, 0, 1.0, 0, -1.0], [1.0, 0, 1.0, 0, -0.2]]))
        gas = task.backend.gas
        assert gas is not None
        pull = done.info["suction_pull"]
        expected = np.array([1.0, 0.2]) * injury_number("suction") + gas.tip_pressure
        np.testing.assert_allclose(pull[pull > 0], expected[pull > 0])
        pulls.append(pull)
    sealed = np.array(pulls) > 0
    assert done is not None and sealed.any(axis=0).all() and not sealed.all(axis=0).any()
    assert done.info["bleeding_pulled"][0] > 0 and done.info["bleeding_pulled"][1] == 0
    let_in = task.step(np.tile([0, 0, 0, 0, 1.0], (2, 1)))
    assert (let_in.info["suction_pull"] == 0).all()


def test_what_would_not_tell_or_show_it_refuses_it() -> None:
    task = ScopeTask(CONFIG, backend="linear", bank=short_bank())
    for call in (lambda: task.in_place, task.advance):
        with pytest.raises(UnsupportedSceneError, match=r"task\.bleeding"):
            call()
    changed: Any = {"observation": "pixels"}
    with pytest.raises(UnsupportedSceneError, match=r"task\.bleeding"):
        ScopeTask(replace(CONFIG, **changed), backend="linear", bank=short_bank())
