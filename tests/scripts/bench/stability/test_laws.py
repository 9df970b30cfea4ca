"""Energy, momentum, units: what holds, and what the measures show when it does not."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.scripts.bench.stability import symmetry
from haustra.scripts.bench.stability.free import (
    MOMENTUM_DRIFT,
    ROD,
    energies_and_momenta,
    gain,
    momentum_drift,
    scaled_difference,
)
from haustra.scripts.bench.stability.passive import settling_energies
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@pytest.fixture(scope="module")
def bend():
    return swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.3, 0.0)]), name="bend")


@pytest.mark.parametrize("free", [False, True])
def test_a_released_rod_never_gains_energy(free):
    energies, _ = energies_and_momenta(ROD, free=free)
    assert gain(energies) < 1e-6
    if not free:
        assert energies[-1] < 0.2 * energies[0]


def test_a_rod_stepped_beyond_what_its_damping_carries_gains_energy():
    """Undamped and without the armature of scenes, the same rod is unstable at the same time step."""
    with np.errstate(all="ignore"):
        energies, _ = energies_and_momenta(
            replace(ROD, relaxation_time=0.0), free=False, timestep=0.005, damped_for=None
        )
    assert not gain(energies) < 1.0


def test_momentum_drifts_with_the_time_step():
    coarse, fine = momentum_drift(ROD, 0.005), momentum_drift(ROD, 0.0025)
    assert 0.4 < fine / coarse < 0.65


def test_momentum_drifts_by_the_steps_error_not_by_armature():
    """By Runge and Kutta the same equations, armature and all, keep momentum."""
    plain, bare = momentum_drift(ROD, 0.005), momentum_drift(ROD, 0.005, armature=False)
    assert abs(bare / plain - 1) < 0.1
    assert momentum_drift(ROD, 0.005, integrator=mujoco.mjtIntegrator.mjINT_RK4) < MOMENTUM_DRIFT


def test_units_do_not_matter_and_physics_does():
    assert scaled_difference(ROD) < 1e-7


def test_a_scope_laid_in_a_colon_only_loses_energy(bend):
    energies = settling_energies(bend)
    assert energies[0] > 0.01
    assert energies.max() < 1.001 * energies[0]
    assert energies[-1] < 0.9 * energies[0]


def test_a_moved_colon_is_the_same_colon_and_a_mirrored_one_its_mirror(bend, monkeypatch):
    monkeypatch.setattr(symmetry, "SECONDS", 1.0)
    path = symmetry.insert(bend, symmetry.PULLS)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([0.1, 0.2, -0.3])
    there = symmetry.insert(symmetry.moved(bend, turn, shift), symmetry.PULLS)
    mirror = np.diag([1.0, 1.0, -1.0])
    seen = symmetry.insert(symmetry.moved(bend, mirror, np.zeros(3)), symmetry.PULLS[[0, 3, 2, 1]], mirrored=True)
    travelled = np.linalg.norm(path[-1] - path[0])
    assert travelled > 0.03
    assert np.linalg.norm(path @ turn.T + shift - there, axis=1).max() < 1e-3 * travelled
    assert np.linalg.norm(path @ mirror - seen, axis=1).max() < 1e-6 * travelled
    assert np.linalg.norm(path - seen, axis=1).max() > 0.1 * travelled  # it does steer out of the plane


def test_the_order_of_hinges_shows_in_a_mirror_unless_it_is_mirrored_too(bend, monkeypatch):
    monkeypatch.setattr(symmetry, "SECONDS", 2.5)
    same, handed = (np.median(symmetry.mirrored_apart(bend, symmetry.OPTIONS, hinges_too=too)) for too in (True, False))
    assert same < 1e-3 * handed
    assert 1e-6 < handed < 1e-3


def test_threads_and_sparsity_change_nothing(bend, monkeypatch):
    monkeypatch.setattr(symmetry, "SECONDS", 1.0)
    assert symmetry.threads_apart(bend) == 0.0
    assert symmetry.sparse_against_dense(bend) < symmetry.SAME_FORCES
