"""The finite-element reference solved afresh agrees with the shipped tables, and with Hertz where theory reaches."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

pytest.importorskip("skfem")
from haustra.errors import InvalidOptionError
from haustra.models.devices.tracked.fem.strip import Equilibrium, MeshOptions, Strip
from haustra.models.devices.tracked.fem.study import force_table, tip_stress
from haustra.models.devices.tracked.law import load_table
from haustra.models.devices.tracked.tread import TreadGeometry

SHORT = MeshOptions(free_length=15e-3)


@pytest.fixture(scope="module")
def strip() -> Strip:
    return Strip.build(TreadGeometry(), span=0.0, options=SHORT)


@pytest.fixture(scope="module")
def pressed(strip: Strip) -> Callable[[float], Equilibrium]:
    """States of the strip under a tip at a place [m], 0.2 mm deep, each solved once."""
    return cache(lambda place: strip.press([place], 2e-4, friction=0.4))


@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_solving_again_gives_the_shipped_force_and_stress(
    strip: Strip, pressed: Callable[[float], Equilibrium], phase: float
) -> None:
    """At 0.2 mm; the shorter free length costs some percent."""
    table = load_table(TreadGeometry())
    state = pressed(phase * 6.5e-3)
    row, column = int(np.argmin(abs(table.phases - phase))), int(np.argmin(abs(table.indentations - 2e-4)))
    assert state.contact_force == pytest.approx(table.forces[row, column], rel=0.05)
    assert tip_stress(strip, state, phase * 6.5e-3) == pytest.approx(table.stresses[row, column], rel=0.05)


def test_forces_balance(strip: Strip) -> None:
    """What the tip pushes, the tissue bears, but for what the held ends carry."""
    state = strip.press([0.0], 2e-4, friction=0.0)
    assert state.tip_forces.sum() == pytest.approx(state.contact_force, rel=0.02)
    assert state.friction_force == pytest.approx(0.0, abs=0.01 * state.contact_force)


def test_a_tip_over_a_tooth_meets_more_than_over_a_gap(pressed: Callable[[float], Equilibrium]) -> None:
    tooth, gap = (pressed(place).contact_force for place in (0.0, 3.25e-3))
    assert tooth > 1.3 * gap


def test_shipped_table_rises_with_indentation_at_every_phase() -> None:
    assert (np.diff(load_table(TreadGeometry()).forces, axis=1) > 0).all()


def test_force_scales_with_the_square_of_length() -> None:
    """Equal materials at a quarter of the size."""
    lengths = {name: value / 4 for name, value in TreadGeometry().to_json().items()}
    # Penalties are pressure over depth, so they grow as lengths shrink.
    options = replace(SHORT, free_length=SHORT.free_length / 4, tooth_penalty=1.6e10, tip_penalty=2.4e11)
    small = Strip.build(TreadGeometry(**lengths), span=0.0, options=options).press([0.0], 2.5e-5, friction=0.0)
    full = Strip.build(TreadGeometry(), span=0.0, options=SHORT).press([0.0], 1e-4, friction=0.0)
    assert small.contact_force == pytest.approx(full.contact_force / 16, rel=0.15)


def test_impossible_requests_are_refused(strip: Strip) -> None:
    with pytest.raises(InvalidOptionError, match="Cannot press"):
        strip.press([0.0], -1e-4, friction=0.4)
    with pytest.raises(InvalidOptionError, match="indentations that rise"):
        force_table(TreadGeometry(), [2e-4, 1e-4])
