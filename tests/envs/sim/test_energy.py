"""Energies are the work that was done on scope and wall. Source: the simulator paper's eq. 6 to 8."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.envs.sim.energy import EnergyMeter
from haustra.models.wall.law import WallContact, apply_contact
from haustra.scripts.bench.accuracy.clamped_rod import EI, LENGTH, clamped, settle, uniform_design


def test_bending_energy_is_that_of_a_beam():
    """A wire's pull F at radius r bends the section of length l by a uniform moment M = F r: E = M^2 l / 2 EI."""
    spec, _ = clamped(uniform_design(), 20)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.actuator("scope/pull_left").ctrl = 8.0
    settle(model, data)
    found = EnergyMeter(model, wall_stiffness=1500.0).read(data)
    assert found.bending == pytest.approx((8.0 * 0.005) ** 2 * (LENGTH / 2) / (2 * EI), rel=0.01)
    assert found.twist == found.wall == 0


def test_wall_energy_is_force_squared_over_twice_the_stiffness():
    spec, cable = clamped(uniform_design(), 20)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    contact = WallContact(stiffness=1500.0, damping=7.5, friction=0.0)
    apply_contact(spec, spec.compile(), cable.geoms, contact, timestep=0.004)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.03, 1, 1], pos=[0.0364, 0, 0], contype=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body(cable.links[-1]).id, 0] = 3.0
    mujoco.mj_step(model, data, 2000)
    forces = data.efc_force[data.contact.efc_address]
    found = EnergyMeter(model, wall_stiffness=1500.0).read(data)
    assert found.wall == pytest.approx(np.sum(forces**2) / (2 * 1500.0), rel=0.02)
    assert found.total == found.bending + found.wall


def test_a_pre_curved_scope_at_rest_stores_nothing():
    design = uniform_design()
    spec, _ = clamped(replace(design, bending=replace(design.bending, bias_up_deg=40, bias_left_deg=30)), 20)
    model = spec.compile()
    data = mujoco.MjData(model)
    settle(model, data)
    assert EnergyMeter(model, wall_stiffness=1500.0).read(data).bending < 1e-12
    axis = data.site("scope/tip").xmat.reshape(3, 3)[:, 2]
    assert np.degrees(np.arccos(axis[2])) == pytest.approx(50, rel=0.01)
    assert np.degrees(np.arctan2(axis[1], axis[0])) == pytest.approx(np.degrees(np.arctan2(30, 40)), abs=1)
