"""The endoscopist's manoeuvres, one at a time."""

import numpy as np
import pytest

from haustra.envs.control.endoscopist import ASSISTANT, EndoscopistSettings, gives_up, rules
from haustra.envs.control.follower import Sensed, Steering
from haustra.models.devices.scope.library import named_design

_STEP = 0.1


class _Handle:
    """A handle whose shaft goes where the hand asks; the tip follows as `tip` says, against a force."""

    def __init__(self, **changed) -> None:
        self.own = EndoscopistSettings(**changed)
        self.steering = Steering.of(named_design("adult"), self.own)
        here = dict.fromkeys(("best_arc", "held_arc", "mark_shaft", "straight_arc"), np.array([0.3]))
        self.memory = self.own.law().begin(np, 1, float)._replace(**here)
        self.time, self.shaft, self.arc, self.roll = 0.0, 0.3, 0.3, 0.0
        self.rates: list[float] = []

    def step(self, *, force: float = 0.0, tip: float = 1.0, torque: float = 0.0) -> float:
        sensed = Sensed(
            time=np.array([self.time]),
            arc=np.array([self.arc]),
            insertion=np.array([self.shaft]),
            roll=np.array([self.roll]),
            hand_lead=np.zeros(1),
            push_force=np.array([force]),
            torque=np.array([torque]),
            wall_force=np.full(1, np.nan),
            tip_force=np.full(1, np.nan),
            bend=(np.full(1, 1.5), np.zeros(1)),
            ahead=(np.zeros(1), np.zeros(1), np.full(1, 0.04)),
        )
        decision, self.memory = rules(np, self.own, self.steering, sensed, self.memory, interval=_STEP)
        rate = float(decision.push_rate[0])
        self.rates.append(rate)
        self.time += _STEP
        self.shaft += rate * _STEP
        self.arc += tip * rate * _STEP
        self.roll += float(decision.roll_rate[0]) * _STEP
        return rate

    @property
    def mode(self) -> float:
        return float(self.memory.mode[0])


def _run(handle: _Handle, seconds: float, **about) -> None:
    for _ in range(round(seconds / _STEP)):
        handle.step(**about)


def test_it_advances_at_its_own_pace_and_rests_after_each_straightening():
    """Forces of the wall are not sensed: nothing depends on them, though they are no numbers here."""
    handle = _Handle()
    _run(handle, 60.0)
    rates = np.array(handle.rates)
    assert rates.max() == pytest.approx(handle.own.advance_rate)
    assert rates.min() == pytest.approx(-handle.own.withdraw_rate)
    assert np.mean(rates == 0) > 0.1
    assert handle.arc > 0.4
    assert np.isfinite(np.array(handle.memory, float)).all()


def test_it_does_not_push_beyond_what_is_gentle():
    handle = _Handle()
    assert handle.step(force=handle.own.gentle_force) == 0
    slows = handle.own.slow_from * handle.own.gentle_force
    assert _Handle().step(force=slows) == pytest.approx(handle.own.advance_rate)
    halfway = _Handle().step(force=(slows + handle.own.gentle_force) / 2)
    assert halfway == pytest.approx(handle.own.advance_rate / 2)


def test_a_shaft_that_goes_in_while_the_tip_stays_is_pulled_back_beyond_the_tips_place():
    """The follower stops pulling where the shaft inside is as long as the colon passed; an endoscopist goes on."""
    handle = _Handle(most_pull=0.3, new_colon=2.0, lost_shaft=0.12, pause=0.0)
    _run(handle, 5.0, tip=0.0, force=5.0)
    while handle.mode != 1.0 and handle.time < 20:
        handle.step(tip=0.0, force=5.0)
    assert handle.mode == 1.0
    _run(handle, 8.0, tip=0.0)
    assert handle.shaft < handle.arc - 0.05


def test_pulling_ends_when_the_lumen_slips_away():
    handle = _Handle(new_colon=2.0)
    while handle.mode != 1.0:
        handle.step(tip=0.0)
    begun = handle.shaft
    while handle.mode == 1.0:
        handle.step(tip=1.0)
    assert 0.9 * handle.own.least_pull < begun - handle.shaft < 3 * handle.own.least_pull
    assert handle.mode == 2.0


def test_pull_and_torque_stand_still_at_their_limits():
    handle = _Handle()
    while handle.mode != 1.0:
        handle.step(tip=0.0)
    assert handle.step(force=-handle.own.pull_force) == 0
    turned = handle.roll
    handle.step(torque=handle.own.torque_limit)
    assert handle.roll == turned


def test_the_assistant_is_asked_when_attempts_have_failed_and_not_before():
    handle = _Handle(patience=8.0, most_attempts=100.0)
    _run(handle, 6.0, tip=0.0, force=5.0)
    assert float(handle.memory.assist[0]) == 0
    asked = set()
    for _ in range(24):
        _run(handle, 10.0, tip=0.0, force=5.0)
        asked.add(float(handle.memory.assist[0]))
    assert len(asked) > 2 and max(asked) < len(ASSISTANT)


def test_gas_is_sucked_out_from_an_attempt_that_fails_until_new_colon_is_seen():
    handle = _Handle(patience=8.0, most_attempts=100.0, suck_after=1.0, suck_from=100.0)
    _run(handle, 6.0, tip=0.0, force=5.0)
    assert handle.memory.sucks == 0
    _run(handle, 10.0, tip=0.0, force=5.0)
    assert handle.memory.attempts > 0 and handle.memory.sucks == 1
    _run(handle, 60.0)
    assert handle.memory.attempts == 0 and handle.memory.sucks == 0
    never = _Handle(patience=8.0, most_attempts=100.0, suck_after=1e3, suck_from=100.0)
    _run(never, 60.0, tip=0.0, force=5.0)
    assert never.memory.attempts > 1 and never.memory.sucks == 0


def test_gas_is_sucked_out_from_the_transverse_colon_on():
    handle = _Handle(suck_from=0.5, new_colon=2.0)
    while handle.arc <= handle.own.suck_from:
        handle.step()
        assert handle.memory.sucks == (handle.arc - handle.rates[-1] * _STEP > handle.own.suck_from)
    handle.step()
    assert handle.memory.sucks == 1


def test_it_pushes_the_firmer_the_longer_no_lumen_passes():
    """Gently as long as it is calm, then harder and harder, never beyond its firmest."""
    handle = _Handle()
    own, memory, firmer = handle.own, handle.memory, []
    for waited in (0.0, own.calm, own.calm + 2.0, 1e3):
        handle.memory = memory._replace(moved_time=np.array([-waited]), attempts=np.zeros(1))
        firmer.append(handle.step(force=own.gentle_force + own.firmer) > 0)
        handle.time = 0.0
    assert firmer == [False, False, True, False]  # after so long it is stuck, and pulls back
    handle.memory = memory._replace(moved_time=np.array([-0.9 * own.patience]))
    assert handle.step(force=own.firm_force) == 0


def test_it_looks_between_two_strokes_and_eases_what_pushes_hard():
    handle = _Handle(new_colon=2.0, patience=600.0)
    _run(handle, handle.own.stroke - _STEP)
    assert min(handle.rates) > 0
    _run(handle, 2 * _STEP)
    assert handle.step(force=0.5 * handle.own.held_force) == 0
    assert handle.step(force=2 * handle.own.held_force) < 0
    _run(handle, handle.own.pause)
    assert handle.rates[-1] > 0


def test_a_loop_that_comes_again_is_left_deeper():
    """Shaft that goes in before it pulls back, while the tip stays: more of it after each attempt."""
    handle, depths = _Handle(new_colon=2.0, pause=0.0), []
    while len(depths) < 3:
        before = handle.mode
        handle.step(tip=0.0)
        if handle.mode == 1.0 != before:
            depths.append(handle.shaft - 0.3)
    assert np.diff(depths) == pytest.approx(handle.own.lost_shaft, abs=0.02)


def test_it_gives_up_after_many_attempts_and_rests():
    handle = _Handle(patience=8.0, most_attempts=2.0)
    _run(handle, 120.0, tip=0.0, force=5.0)
    handle.rates.clear()
    _run(handle, 60.0, tip=0.0, force=5.0)
    assert handle.mode == 2.0 and not any(handle.rates)
    assert gives_up(handle.own, handle.memory)


def test_it_does_not_give_up_before():
    handle = _Handle(patience=8.0, most_attempts=2.0)
    while handle.memory.attempts[0] < 2:
        assert not gives_up(handle.own, handle.memory)
        handle.step(tip=0.0, force=5.0)
    assert handle.mode != 2.0 and not gives_up(handle.own, handle.memory)  # the last attempt is made, too


def test_a_tip_that_is_caught_is_let_go_straight_again_and_again():
    """Where no lumen passes, the wires ask for no more than a small bend in every second half."""
    handle = _Handle(new_colon=2.0, patience=600.0)
    handle.memory = handle.memory._replace(bend_up=np.array([2.0]))
    asked = []
    for _ in range(round(handle.own.unbend_time / _STEP)):
        handle.step(tip=0.0, force=5.0)
        asked.append(float(np.hypot(handle.memory.bend_up[0], handle.memory.bend_left[0])))
    half = len(asked) // 2
    assert max(asked[:half]) > handle.own.unbent >= max(asked[half + 1 :]) - 1e-9
