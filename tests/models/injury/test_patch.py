"""What counts as one contact does not depend on how finely the shaft is cut."""

import numpy as np
import pytest

from haustra.envs.runs.measure.load import contact_forces
from haustra.models.injury.patch import CONTACT_LENGTH


@pytest.mark.parametrize("links", [1, 2, 3])
def test_a_load_spread_along_a_shaft_is_the_same_on_contacts_of_fine_links(links: int) -> None:
    """A contact's length of a load per length, away from the ends; half of what lies beyond is missing at an end."""
    per_length, length = 200.0, CONTACT_LENGTH / links
    lengths = np.full(30, length)
    found = contact_forces(np, per_length * lengths[None], lengths)[0]
    np.testing.assert_allclose(found[1:-1], per_length * CONTACT_LENGTH)
    assert found[0] == found[-1] == pytest.approx(per_length * (CONTACT_LENGTH + length) / 2)


def test_one_place_that_presses_bears_as_much_on_fine_links_and_all_of_it_on_coarse_ones() -> None:
    for length in (CONTACT_LENGTH / 3, CONTACT_LENGTH, 3 * CONTACT_LENGTH):
        forces = np.zeros(9)
        forces[4] = 7.0
        assert contact_forces(np, forces, np.full(9, length)).max() == 7.0
