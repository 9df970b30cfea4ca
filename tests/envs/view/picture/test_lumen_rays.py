"""One law of where places stand in a lumen's table, read at its nearest number or smoothly."""

from types import SimpleNamespace

import numpy as np
import pytest

from haustra.envs.tasks.sight import Sight, _Station
from haustra.envs.view.picture.lumen_rays import Line, around, crossing, wall_at
from haustra.models.wall.vectors import of
from tests.task_bank import short_bank


def looked_up(at: np.ndarray, arcs: np.ndarray, *, nearest: bool) -> SimpleNamespace:
    case = short_bank().cases[0]
    lumens = Sight([case]).lumens
    line = Line(lambda row: _Station(lumens, row), case.step, 0, float(len(case.points)))
    found = around(np, line, case.sight.shape[1], of(at), arcs, nearest=nearest)
    beside, after = (found.column + 1) % case.sight.shape[1], np.minimum(found.row + 1, len(case.points) - 1)
    four = [case.sight[row, column] for row in (found.row, after) for column in (found.column, beside)]
    wall = four[0] if nearest else wall_at(found, four, case.sight.shape[1])
    return SimpleNamespace(**found._asdict(), wall=wall)


@pytest.mark.parametrize("nearest", [True, False], ids=["nearest", "smooth"])
def test_places_of_the_table_are_its_wall(nearest: bool) -> None:
    """At every station and angle both ways say the table's own number, from wherever near it a ray came."""
    case, random = short_bank().cases[0], np.random.default_rng(0)
    rows, columns = random.integers(2, len(case.points) - 2, 500), random.integers(0, case.sight.shape[1], 500)
    places = Sight([case]).surface(0, rows, columns)
    near = case.step * rows + random.uniform(-0.002, 0.002, 500)
    found = looked_up(places, near, nearest=nearest)
    known = case.sight[rows, columns]
    same = np.abs(found.arc - case.step * rows) < 0.1 * case.step
    assert same.mean() > 0.9  # on the inside of a bend, places stand beside several stations
    np.testing.assert_allclose(found.aside[same], known[same], atol=2e-6)
    np.testing.assert_allclose(found.wall[same], known[same], atol=1e-4)


def test_between_places_the_smooth_way_is_smooth() -> None:
    """From one angle to the next the nearest number jumps; the other goes along the chord."""
    case = short_bank().cases[0]
    row, turn = 20, 2 * np.pi * np.linspace(0, 3, 61) / case.sight.shape[1]
    first, second = case.frames[row, :, 0], case.frames[row, :, 1]
    places = case.points[row] + 0.01 * (np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second)
    arcs = np.full(61, row * case.step)
    jumps, smooth = (looked_up(places, arcs, nearest=each) for each in (True, False))
    assert len(np.unique(jumps.column)) == 4
    assert np.abs(np.diff(smooth.wall)).max() < 0.2 * np.abs(case.sight[row, :4]).max() / 20
    np.testing.assert_allclose(jumps.wall[::20], smooth.wall[::20], atol=1e-6)


def test_false_position_is_exact_where_room_falls_evenly() -> None:
    """And never leaves the interval, nor more than is asked of its ends."""
    low, high = np.array([0.01, 0.02]), np.array([0.02, 0.05])
    assert crossing(np, low, np.array([0.003, 0.001]), high, np.array([-0.001, -0.002])) == pytest.approx(
        [0.0175, 0.03]
    )
    assert crossing(np, low, 1e-9, high, -1.0, least=0.02) == pytest.approx(low + 0.02 * (high - low))
