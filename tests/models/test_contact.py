"""A press on the wall answers with F = K d, whatever presses and wherever along the scope.

Source: Hooke's law for the wall as in the colonoscopy simulator the project implements (its eq. 3).
"""

import mujoco
import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.models.contact import WallContact, apply_contact
from tests.physics.clamped_rod import clamped, uniform_design

STIFFNESS = 1500.0


def pressed(link: int, *, load: float, timestep: float) -> list[float]:
    """Stiffness of each loaded contact, force over depth, of a rod beside a wall that is pressed into it."""
    spec, cable = clamped(uniform_design(), 20, timestep=timestep)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    bare = spec.compile()
    contact = WallContact(stiffness=STIFFNESS, damping=7.5, friction=0.1)
    apply_contact(spec, bare, cable.geoms, contact, timestep=timestep)
    wall = [0.03, 1.0, 1.0]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=wall, pos=[0.0064 + 0.03, 0, 0], contype=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body(cable.links[link]).id, 0] = load
    mujoco.mj_step(model, data, int(8 / timestep))
    assert np.abs(data.qvel).max() < 1e-3
    force = data.efc_force[data.contact.efc_address]
    depth = -data.contact.dist
    return list((force / depth)[depth > 1e-5])


@pytest.mark.parametrize("timestep", [0.001, 0.004])
@pytest.mark.parametrize("link", [-1, -4, 10])
@pytest.mark.parametrize("load", [1.0, 10.0])
def test_static_stiffness_is_exact_along_the_chain(link, load, timestep):
    stiffness = pressed(link, load=load, timestep=timestep)
    assert stiffness
    np.testing.assert_allclose(stiffness, STIFFNESS, rtol=0.01)


@pytest.mark.parametrize(
    ("stiffness", "damping", "friction"), [(-1.0, 1.0, 0.1), (1e3, float("nan"), 0.1), (1e3, 1.0, -0.1)]
)
def test_impossible_contacts_are_refused(stiffness, damping, friction):
    with pytest.raises(InvalidOptionError):
        WallContact(stiffness=stiffness, damping=damping, friction=friction)
