"""When a page is sent pictures."""

from typing import Any

import numpy as np

from haustra.envs.console import source as sources
from haustra.envs.console.painter import Camera, Glance
from haustra.envs.console.session import Session
from haustra.envs.console.source import INTERVAL, View
from haustra.envs.console.vehicles import make_vehicle
from haustra.envs.sim.moved_colon import CurrentColon


class _Painter:
    """Draws when it is told to."""

    def __init__(self, camera: Camera) -> None:
        self.busy, self.asked = False, 0

    def ask(self, glance: Glance, about: Any) -> None:
        assert not self.busy
        self.busy, self.asked = True, self.asked + 1


def test_a_picture_is_asked_for_as_soon_as_the_one_before_is_drawn(colon_folder, capsule, monkeypatch) -> None:
    """What takes a little longer than the interval does not take two of them."""
    monkeypatch.setattr(sources, "Painter", _Painter)
    session = Session(make_vehicle(colon_folder, capsule))
    view = View(session.vehicle.around, 0, 64)
    painter: Any = view.painter

    def ask(share: float) -> int:
        look = session.look
        view.glance(share * INTERVAL, lambda: (look.row, look.frame, {}))
        return painter.asked

    assert ask(0.0) == 1
    assert ask(1.1) == 1, "one is being drawn"
    painter.busy = False
    assert ask(1.2) == 2
    painter.busy = False
    assert ask(1.9) == 2, "one was asked for just now"
    assert ask(2.3) == 3
    session.vehicle.close()


def test_a_colon_that_moves_is_drawn_where_the_scope_met_it(colon_folder, scope) -> None:
    """What is drawn with a colon's tables is seen from its entry, which does not look along the scene's axes."""
    vehicle: Any = make_vehicle(colon_folder, scope)
    session, around = Session(vehicle), vehicle.around
    assert not np.allclose(around.axes, np.eye(3))
    session.hold({"push": 0.5})
    while session.time < 3.0:
        session.tick()
    met = vehicle._seen.way
    assert np.linalg.norm(met - around.colon.centreline.points, axis=1).max() > 5e-4
    drawn = CurrentColon(around.colon, around.tables, around.origin, around.axes)
    np.testing.assert_allclose(drawn.way(session.look.frame["displacement"]), met, atol=1e-9)
    session.close()
