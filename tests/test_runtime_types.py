"""The checker that holds haustra's functions to their annotations in tests."""

from typing import Any

import jaxtyping
import numpy as np
import pytest
from jaxtyping import TypeCheckError
from runtime_types import check, check_anew, unchecked

from haustra.models.anatomy.frames import rotation_minimising_frames


def test_the_first_calls_in_a_test_are_checked_and_those_of_the_next_test_too() -> None:
    line, flat = np.linspace(0, 1, 5)[:, None] * np.ones(3), np.zeros((5, 2))
    with pytest.raises(TypeCheckError):
        rotation_minimising_frames(flat)
    for _ in range(100):
        rotation_minimising_frames(line)
    check_anew()
    with pytest.raises(TypeCheckError):
        rotation_minimising_frames(flat)


def test_a_function_within_a_function_is_checked_unless_it_is_made_where_checks_are_left_out() -> None:
    def of_numbers() -> Any:
        @jaxtyping.jaxtyped(typechecker=check)
        def doubled(number: int) -> int:
            return 2 * number

        return doubled

    checked = of_numbers()
    with unchecked():
        plain = of_numbers()
    assert plain("ab") == "abab"
    with pytest.raises(TypeCheckError):
        checked("ab")
