"""A press on the wall answers with F = K d, whatever presses and wherever along the scope.

Source: Hooke's law for the wall as in the colonoscopy simulator the project implements (its eq. 3).
"""

import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.models.wall.law import WallContact
from haustra.scripts.bench.accuracy.press import STIFFNESS, contact_stiffness, press


@pytest.mark.parametrize("timestep", [0.001, 0.004])
@pytest.mark.parametrize("link", [-1, -4, 10])
@pytest.mark.parametrize("load", [1.0, 10.0])
def test_static_stiffness_is_exact_along_the_chain(link, load, timestep):
    model, data = press(link, load=load, timestep=timestep)
    assert np.abs(data.qvel).max() < 1e-3
    stiffness = contact_stiffness(model, data)
    assert len(stiffness)
    np.testing.assert_allclose(stiffness, STIFFNESS, rtol=0.01)


@pytest.mark.parametrize(
    ("stiffness", "damping", "friction"), [(-1.0, 1.0, 0.1), (1e3, float("nan"), 0.1), (1e3, 1.0, -0.1)]
)
def test_impossible_contacts_are_refused(stiffness, damping, friction):
    with pytest.raises(InvalidOptionError):
        WallContact(stiffness=stiffness, damping=damping, friction=friction)
