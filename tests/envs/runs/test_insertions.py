"""Many insertions at once: ends, scores and independence of worlds."""

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertions import Insertions, run_insertions
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.scope_bank import ScopeBank, build_bank
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def bank() -> ScopeBank:
    bent = swept_colon(winding([(0.1, 0.0), (0.12, 1.2), (0.1, 0.0)]), name="bend")
    options = SceneOptions(shaft_cell=0.0625, bending_cell=0.034, sample_spacing=0.03)
    return build_bank([straight_tube(0.3), bent], named_design("paediatric"), options)


@pytest.fixture(scope="module")
def runs(bank: ScopeBank) -> Insertions:
    """The straight tube, the bend, the bend with a hand that hardly pushes, and with a wall that hardly holds."""
    return run_insertions(
        bank,
        worlds=4,
        seconds=14,
        colon=np.array([0, 1, 1, 1]),
        push_limit=np.array([43.0, 43.0, 0.05, 43.0]),
        stiffness=np.array([1500.0, 1500.0, 1500.0, 0.5]),
    )


def test_short_tubes_are_passed_and_a_hand_without_force_is_not(runs: Insertions) -> None:
    assert runs.outcome[:2] == (Outcome.REACHED_CAECUM, Outcome.REACHED_CAECUM)
    assert runs.outcome[2] in (Outcome.TIME_UP, Outcome.STUCK)
    assert runs.tip_arc_max[0] == pytest.approx(0.27, abs=0.005)
    assert runs.tip_arc_max[2] < 0.25


def test_a_scope_that_leaves_through_the_wall_has_escaped(runs: Insertions) -> None:
    """As a single run ends: three centimetres outside, with the wall that deep."""
    assert runs.outcome[3] is Outcome.ESCAPED
    assert runs.simulated[3] < 13


def test_scores_are_those_of_the_run_up_to_its_end(runs: Insertions) -> None:
    assert runs.simulated[0] < 13
    assert runs.simulated[2] == pytest.approx(14, abs=0.03)
    assert runs.push_force_peak[2] <= 0.05 + 1e-6
    assert runs.wall_force_peak[1] > runs.wall_force_mean[1] > 0
    assert runs.insertion[0] == pytest.approx(0.27, abs=0.01)


def test_many_worlds_cannot_be_steered_by_wheels(bank: ScopeBank) -> None:
    with pytest.raises(InvalidOptionError, match="wheels"):
        WorldsFollower(FollowerSettings(steer="wheels"), bank.tip_links)


def test_unknown_parameters_are_refused(bank: ScopeBank) -> None:
    with pytest.raises(InvalidOptionError, match="stifness"):
        JaxScopes.of(bank.scene).parameters(bank.scene, 1, stifness=1.0)
