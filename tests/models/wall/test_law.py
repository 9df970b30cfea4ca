"""A press on the wall answers with F = K d, whatever presses and wherever along the scope.

Source: Hooke's law for the wall as in the colonoscopy simulator the project implements (its eq. 3).
"""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.wall.law import (
    IMPEDANCE_RATIO,
    SLIP_SPEED,
    WallContact,
    apply_contact,
    contact_parameters,
    implicit_contact,
    normal_force,
    require_impedance_ratio,
)
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


def test_a_stiffness_that_mujoco_would_clamp_is_refused() -> None:
    """Impedance is held to 0.9999 in silence: a wall of 1e9 N/m would answer a light link with another stiffness."""
    law = WallContact(stiffness=9e8, damping=1.0, friction=0.1)
    with pytest.raises(InvalidOptionError, match="'tip' is outside what MuJoCo can honour"):
        contact_parameters(100.0, law, timestep=0.005, where="tip")


@pytest.mark.parametrize("load", [0.1, 10.0])
@pytest.mark.parametrize("speed", [1e-4, 1e-3, 0.05])
def test_friction_depends_on_speed_alike_at_any_load(load: float, speed: float) -> None:
    """Coulomb's law above the slip speed, a damper of mu F / v_s below it."""
    depth = load / 1500.0
    law = implicit_contact(
        np,
        np.array([depth]),
        np.array([[0.0, 0.0, 1.0]]),
        np.array([[speed, 0.0, 0.0]]),
        np.array([False]),
        stiffness=1500.0,
        ahead=0.01,
        friction=0.3,
    )
    force = law.force(np, np.array([[speed, 0.0, 0.0]]))[0]
    np.testing.assert_allclose(force, [-0.3 * load * min(speed / SLIP_SPEED, 1.0), 0.0, load], rtol=1e-6, atol=1e-9)


def test_friction_may_rise_with_speed_as_on_mucus_but_not_in_mujocos_own_contacts() -> None:
    """Lyle 2013, Tribol Lett 51:377: a sled on small bowel meets 0.007 to 0.054, more the faster it goes."""
    moving = np.array([[0.06, 0.0, 0.0]])
    law = implicit_contact(
        np,
        np.array([1e-3]),
        np.array([[0.0, 0.0, 1.0]]),
        moving,
        np.array([False]),
        stiffness=1500.0,
        ahead=0.01,
        friction=0.007,
        friction_rise=0.78,
    )
    assert -law.force(np, moving)[0, 0] == pytest.approx((0.007 + 0.78 * 0.06) * 1.5, rel=1e-6)
    spec = mujoco.MjSpec()
    plain = WallContact(1500.0, 7.5, 0.007)
    for law in (replace(plain, friction_rise=0.78), replace(plain, elasticity="exponential")):
        with pytest.raises(UnsupportedSceneError, match="rises with speed and an elasticity"):
            apply_contact(spec, spec.compile(), [], law, timestep=0.005)


def test_the_normal_force_is_that_of_the_step_and_never_pulls() -> None:
    spring, leaving = np.array([1.5, 1.5, 1.5, -1.5]), np.array([0.0, 0.05, 0.2, -0.1])
    np.testing.assert_allclose(normal_force(np, spring, 15.0, leaving), [1.5, 0.75, 0.0, 0.0])


def test_one_place_writes_the_impedance_ratio_and_never_lowers_it() -> None:
    spec = mujoco.MjSpec()
    for ratio in (1e3, IMPEDANCE_RATIO):
        require_impedance_ratio(spec, ratio)
    assert spec.option.impratio == 1e3
    root = Path(__file__).parents[3]
    files = [path for room in ("models", "envs") for path in (root / room).rglob("*.py")]
    writers = [path.name for path in files if "option.impratio =" in path.read_text(encoding="utf-8")]
    assert writers == ["law.py"]
