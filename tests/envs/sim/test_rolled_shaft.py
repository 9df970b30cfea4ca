"""A shaft that is pressed onto a wall and rolled meets the torque mu F R: friction acts at its surface.

Theory: Coulomb's law at the place of contact, whose lever about the shaft's axis is the shaft's radius. What the
shaft's own damping takes is measured without friction and taken off.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.scope_colon_set import build_bank
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.tube_colon import square_tube, straight_tube, wedge_wall

FRICTION, RATE = 0.3, 0.25
"""Coefficient of friction [1], and speed of the roll [rad/s]: 1.6 mm/s at the surface, above the slip speed."""
_FAST = 1.0
"""Speed of the roll in a corner [rad/s], whose mean over half a turn is read: hinges of a bent shaft, as a universal
joint, do not turn evenly."""
_SETTLE, _ROLL, _READ = 200, 900, 300
"""Steps before the roll, of it, and whose mean is read. At first the shaft rolls up the side of the tube."""
_ROLL_IN_CORNER = 300
"""Steps of the roll in a corner before it is read: there it does not roll up."""


_LYING = SceneOptions(
    insertion_limit=0.3,
    shaft_cell=0.0625,
    bending_cell=0.034,
    start_depth=0.28,
    friction=FRICTION,
    gravity=(0.0, -100.0, 0.0),
)
"""A scope that lies in a tube and presses it with some 0.3 N at every sphere."""


def _native(law: Literal["pieces", "planes"]) -> tuple[float, float]:
    """Torque of friction [N m], and what theory says, in a corner: on a facet of a tube the shaft would roll away."""
    options = replace(_LYING, wall_law=law)
    if law == "pieces":  # where they overlap a device by d, MuJoCo's contact lies d/2 below its surface: it is light
        options = replace(options, gravity=(0.0, -10.0, 0.0))
    torque, force = _rolled(options)
    return torque - _rolled(replace(options, friction=0.0))[0], FRICTION * force * named_design("adult").diameter / 2


def _rolled(options: SceneOptions) -> tuple[float, float]:
    """Torque of the hand [N m], and the sum of normal forces [N]."""
    wall = wedge_wall(sectors=4)
    backend = NativeEngine(build_scene(square_tube(), wall, named_design("adult"), options, show_lumen=False))
    assert backend.step(Controls(0.0, 0.0), _SETTLE)
    assert backend.step(Controls(0.0, _FAST), _ROLL_IN_CORNER)
    torques, forces = [], []
    for _ in range(round(np.pi / _FAST / options.timestep)):
        assert backend.step(Controls(0.0, _FAST), 1)
        rows = backend.data.contact.efc_address
        forces.append(backend.data.efc_force[rows[rows >= 0]].sum())
        torques.append(backend.read().torque)
    return float(np.mean(torques)), float(np.mean(forces))


def _batch(make: Callable) -> tuple[float, float]:
    """Mean torque [N m] and wall force [N] in a batch: one world with friction, one without."""
    bank = build_bank([straight_tube()], named_design("adult"), _LYING)
    batch = make(bank.scene, bank.tables)
    batch.reset(np.arange(2), np.zeros(2, int), Conditions(np.array([FRICTION, 0.0]), np.full(2, 1500.0), np.ones(2)))

    def step(rate: float, count: int) -> None:
        assert batch.step(Controls(np.zeros(2), np.full(2, rate), np.zeros((2, 4))), count).all()

    step(0.0, _SETTLE)
    step(RATE, _ROLL)
    torques, forces = [], []
    for _ in range(_READ):
        step(RATE, 1)
        seen = batch.read()
        torques.append(seen.torque[0] - seen.torque[1])
        forces.append(seen.link_forces[0].sum())
    return float(np.mean(torques)), FRICTION * float(np.mean(forces)) * bank.scene.cable.radius


def _device(backend: str) -> tuple[float, float]:
    from haustra.envs.sim.load import load_backend

    return _batch(lambda scene, tables: load_backend(backend, scene, tables, worlds=2))


def _warp() -> tuple[float, float]:
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    return _device("warp")


BACKENDS: dict[str, Callable[[], tuple[float, float]]] = {
    "native, pieces": lambda: _native("pieces"),
    "native, planes": lambda: _native("planes"),
    "native batch, table": lambda: _batch(lambda scene, tables: NativeBackend(scene, tables, worlds=2)),
    "linear, table": lambda: _device("linear"),
    "warp, table": _warp,
}


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_pressed_shaft_that_is_rolled_meets_friction_times_force_times_radius(backend: str) -> None:
    torque, theory = BACKENDS[backend]()
    assert theory > 1e-4
    assert torque == pytest.approx(theory, rel=0.01)
