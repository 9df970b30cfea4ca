"""How the follower backs off when it straightens a colon."""

import numpy as np

from haustra.envs.control.follower import LEAST_RETREAT, FollowerSettings, LumenFollower
from haustra.envs.sim.energy import Energies
from haustra.envs.sim.state import Readings
from haustra.models.devices.scope.library import named_design
from tests.tube_colon import straight_tube

_INTERVAL = 0.02
_JAMMED = Readings(
    time=10.0,
    insertion=0.6,
    roll=0.0,
    hand_lead=0.0,
    tip=np.zeros(3),
    tip_frame=np.eye(3),
    bend=np.zeros(2),
    push_force=40.0,
    torque=0.0,
    pulls=np.zeros(4),
    link_forces=np.zeros(5),
    contacts=0,
    energies=Energies(0.0, 0.0, 0.0),
)


def _pulled_back(settings: FollowerSettings, arcs: np.ndarray) -> float:
    """How far it pulls a jammed shaft back, while the tip's arc length goes as given, centimetre by centimetre [m]."""
    colon = straight_tube()
    follower = LumenFollower(colon.centreline, named_design("adult"), tip_links=3, settings=settings)
    seen = _JAMMED._replace(push_force=0.0, time=0.0)
    follower.act(seen, float(arcs[0]), _INTERVAL)
    seen = _JAMMED
    for step, arc in enumerate(arcs):
        seen = _JAMMED._replace(insertion=0.6 - 0.01 * step, push_force=40.0 if step == 0 else 0.0)
        if follower.act(seen, float(arc), _INTERVAL).push_rate >= 0:
            break
    return 0.6 - seen.insertion


def test_it_pulls_on_while_the_tip_holds_and_stops_when_it_slips():
    settings = FollowerSettings(straighten=True)
    held = np.full(50, 0.2)
    slipping = np.concatenate([np.full(20, 0.2), 0.2 - 0.01 * np.arange(30)])
    assert abs(_pulled_back(settings, held) - settings.straighten_distance) < 0.011
    assert 0.2 + settings.slip - 0.005 < _pulled_back(settings, slipping) < 0.2 + settings.slip + 0.021
    assert abs(_pulled_back(FollowerSettings(), held) - FollowerSettings().retreat_distance) < 0.011


def test_it_stops_when_the_shaft_is_straight():
    """No more scope inside than colon passed: there is no loop left to take out."""
    settings = FollowerSettings(straighten=True)
    assert abs(_pulled_back(settings, np.full(50, 0.45)) - 0.15) < 0.011
    assert abs(_pulled_back(settings, np.full(50, 0.62)) - LEAST_RETREAT) < 0.011


def test_it_pulls_no_harder_than_it_may():
    settings = FollowerSettings(straighten=True)
    follower = LumenFollower(straight_tube().centreline, named_design("adult"), tip_links=3, settings=settings)
    follower.act(_JAMMED._replace(time=0.0, push_force=0.0), 0.2, _INTERVAL)
    follower.act(_JAMMED, 0.2, _INTERVAL)
    assert follower.act(_JAMMED._replace(push_force=0.0), 0.2, _INTERVAL).push_rate == -settings.retreat_rate
    hard = _JAMMED._replace(insertion=0.55, push_force=0.0, link_forces=np.full(5, settings.wall_force_limit))
    assert follower.act(hard, 0.2, _INTERVAL).push_rate == 0.0
