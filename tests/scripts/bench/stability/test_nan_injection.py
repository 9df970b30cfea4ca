"""A number that is none is caught where it enters, and stays in its world."""

import numpy as np
import pytest

from haustra.envs.sim.native_batch import NativeBackend
from haustra.scripts.bench.stability.nan_injection import (
    BAD,
    batch_cases,
    design_cases,
    judge,
    single_cases,
    vector_cases,
)
from tests.task_bank import short_bank


@pytest.fixture(scope="module")
def bank():
    return short_bank()


def test_worlds_of_a_batch_are_lost_alone(bank):
    found = batch_cases("native batch", lambda: NativeBackend(bank.scene, bank.tables, worlds=3))
    assert len(found) == 7 * len(BAD)
    assert [case for case in found if not case.sound] == []
    assert all(case.caught == "diverged" for case in found if case.array == "pulls")


def test_a_backend_of_one_scope_refuses(bank):
    assert {case.caught for case in single_cases(bank)} == {"refused"}


def test_a_vector_environment_ends_the_episode(bank):
    found = vector_cases(bank)
    assert all(case.sound and case.caught == "diverged" for case in found)


def test_a_sweep_refuses_every_number_by_name():
    found = design_cases()
    assert [case for case in found if case.caught != "refused"] == []
    assert len({case.array for case in found}) > 20


def test_what_is_not_caught_misses_the_bar(bank):
    case = single_cases(bank)[0]
    silent = type(case)("native", "push_rate", np.nan, "", neighbours_same=False, finite=True)
    assert [criterion.met for criterion in judge([case, silent]).criteria] == [False, False, True]
