"""Laws of the wall's force against its depth: what each must keep, and Fung's exponential in closed form.

Source: Fung 1967, Am J Physiol 213:1532: the slope of the load of soft tissue grows with the load, dE/dd = K + b E.
"""

from dataclasses import replace

import numpy as np
import pytest

from haustra.assets import asset
from haustra.errors import InvalidOptionError
from haustra.models.scene import SceneOptions
from haustra.models.wall.elasticity import ELASTICITIES, depth_under, exponential, stiffest, stored_energy
from haustra.models.wall.law import WallContact, contact_parameters
from haustra.quantity import load_quantities

K = 1500.0
B = load_quantities(asset("numbers/contact.toml"))["contact.stiffening"].value
DEPTHS = np.array([1e-5, 1e-3, 5e-3, 0.01, 0.02, 0.03])


@pytest.mark.parametrize("name", ELASTICITIES)
def test_every_law_begins_at_the_stiffness_never_softens_and_stays_finite(name: str) -> None:
    """An implicit step with the slope at its beginning is stable where no secant is steeper than the slope."""
    law = ELASTICITIES[name]
    lumen = np.array([-1.0, -1e-3, 0.0])
    depth, slope = law(np, lumen, K)
    np.testing.assert_array_equal(depth, lumen)
    np.testing.assert_array_equal(slope * np.ones(3), K)
    bent, firm = law(np, DEPTHS, np.full_like(DEPTHS, K))
    force, step = firm * bent, 1e-7
    ahead, behind = (np.multiply(*law(np, DEPTHS + way, np.full_like(DEPTHS, K))) for way in (step, -step))
    np.testing.assert_allclose(firm, (ahead - behind) / (2 * step), rtol=1e-4)
    assert (firm >= force / DEPTHS * (1 - 1e-12)).all()
    assert np.isfinite(law(np, np.array([100.0]), K)[1]).all()
    np.testing.assert_allclose(depth_under(name, force, K), DEPTHS, rtol=1e-9)


def test_the_exponential_law_is_fungs() -> None:
    bent, firm = exponential(np, DEPTHS, K)
    force = K / B * np.expm1(B * DEPTHS)
    np.testing.assert_allclose(firm * bent, force, rtol=1e-9)
    np.testing.assert_allclose(firm, K + B * force, rtol=1e-9)
    energy = K / B**2 * (np.expm1(B * DEPTHS) - B * DEPTHS)
    np.testing.assert_allclose(stored_energy("exponential", DEPTHS, K), energy, rtol=1e-6)
    assert stiffest("exponential", K) == pytest.approx(10 * K)


def test_only_walls_whose_planes_are_placed_take_another_law() -> None:
    with pytest.raises(InvalidOptionError, match=r"'cubic' is not known\. Known: linear, exponential"):
        SceneOptions(elasticity="cubic")
    for law in ("pieces", "planes"):
        for name, value in (("elasticity", "exponential"), ("friction_rise", 0.5)):
            with pytest.raises(InvalidOptionError, match=f"{name} is {value}, which .* '{law}' has not"):
                replace(SceneOptions(wall_law=law), **{name: value})


def test_a_law_that_ends_stiffer_than_mujoco_honours_is_refused() -> None:
    """Impedance is held to 0.9999 in silence, where the wall is deepest just as where it is hardly pressed."""
    contact_parameters(100.0, WallContact(2e5, 1000.0, 0.1), timestep=0.005, where="tip")
    with pytest.raises(InvalidOptionError, match=r"stiffness 2e\+06 N/m on 'tip'"):
        law = WallContact(2e5, 1000.0, 0.1, elasticity="exponential")
        contact_parameters(100.0, law, timestep=0.005, where="tip")
