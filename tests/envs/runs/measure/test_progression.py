"""Own measures of progression, on shapes whose answer is known."""

import numpy as np
import pytest

from haustra.envs.runs.measure.progression import progression_scores
from haustra.envs.sim.coils import COIL_DISTANCES

COUNT = 500
TIME = 0.02 * np.arange(1, COUNT + 1)
DISTANCES = np.array(COIL_DISTANCES)


def _along(arc: np.ndarray) -> np.ndarray:
    """Places of a straight way."""
    return np.stack([0 * arc, 0 * arc, arc], axis=-1)


def _round(arc: np.ndarray, radius: float = 0.1) -> np.ndarray:
    """Places of a helix that rises by 2 cm a turn, to the right."""
    turn = arc / np.hypot(radius, 0.02 / (2 * np.pi))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.02 * turn / (2 * np.pi)], axis=-1)


def _scores(place, insertion, **changed) -> dict[str, float]:
    tip, coils = place(insertion), place(insertion[:, None] - DISTANCES)
    known = {"tip": tip, "coils": coils, "insertion": insertion, "progress": insertion / 0.8} | changed
    return progression_scores(TIME, **known)


def test_a_scope_that_follows_its_tip_straight_ahead() -> None:
    """Travel is what was pushed, nothing loops, and the shaft lies where the tip was."""
    found = _scores(_along, np.linspace(0.0, 0.4, COUNT))
    assert found["cops_own"] == pytest.approx(25.0, abs=0.1)
    assert found["cops3d_travel_length_m"] == pytest.approx(0.4, rel=0.02)
    assert found["cops3d_tip_progression"] == pytest.approx(1.0, abs=0.01)
    assert found["cops3d_chase_efficiency_mm"] < 3.0
    assert found["cops3d_shaft_without_tip_m"] == 0.0
    assert found["cops3d_looping_turns"] == pytest.approx(0.0, abs=1e-9)


def test_a_shaft_that_loops_while_the_tip_stays() -> None:
    """What is pushed then is shaft without tip, and the coils leave the tip's path."""
    inserted = np.concatenate([np.linspace(0.0, 0.3, 250), np.linspace(0.3, 0.5, 250)])
    ahead = np.minimum(inserted, 0.3)
    coils = _along(ahead[:, None] - DISTANCES)
    coils[:, :, 0] += np.maximum(inserted - 0.3, 0.0)[:, None]
    found = _scores(_along, inserted, tip=_along(ahead), coils=coils)
    assert found["cops3d_shaft_without_tip_m"] == pytest.approx(0.2, abs=0.01)
    assert found["cops3d_chase_efficiency_mm"] > 20


def test_a_helix_loops_by_its_writhe() -> None:
    """A tight helix has nearly one turn of writhe a turn; back and forth, a tip travels twice as far."""
    inserted = np.full(COUNT, 0.75)
    loops = _scores(_round, inserted)["cops3d_looping_turns"]
    assert 0.2 < loops < 1.3
    there = np.concatenate([np.linspace(0.0, 0.4, 250), np.linspace(0.4, 0.0, 250)])
    assert _scores(_along, there)["cops3d_tip_progression"] == pytest.approx(2.0, abs=0.03)


def test_a_run_without_records_scores_nothing() -> None:
    none = np.zeros(0)
    found = progression_scores(none, np.zeros((0, 3)), np.zeros((0, 8, 3)), none, progress=none)
    assert set(found.values()) == {0.0} and len(found) == 6
