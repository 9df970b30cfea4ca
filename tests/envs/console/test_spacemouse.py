"""A SpaceMouse moves levers, leaves others to the page, and lets go when it is silent or unplugged; a fake device."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from haustra.envs.console import source as sources
from haustra.envs.console.session import Session
from haustra.envs.console.source import WATCHDOG, Drive
from haustra.envs.console.spacemouse import DEAD_ZONE, SpaceMouse, find_space_mouse, shares
from haustra.envs.console.vehicles import make_vehicle
from haustra.errors import InvalidOptionError, MissingDependencyError, UnsupportedSceneError
from haustra.scripts.main import BAD_INPUT, main


@dataclass
class _State:
    t: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    buttons: Sequence[int] = field(default_factory=lambda: [0, 0])


class _Fake:
    """A device whose cap is held somewhere, or that hangs, or is unplugged."""

    def __init__(self) -> None:
        self.state, self.silent, self.plugged, self.closed = _State(), False, True, False

    def hold(self, **axes: Any) -> None:
        self.state = _State(t=self.state.t + 1e-6, **axes)

    def read(self) -> _State:
        if not self.plugged:
            raise RuntimeError("Failed to read from HID device: -1")
        if not self.silent:
            self.state.t += 0.008
        return self.state

    def close(self) -> None:
        self.closed = True


class _Painter:
    def __init__(self, camera: Any) -> None:
        self.ready, self.busy = True, False

    def close(self) -> None:
        return


@pytest.fixture
def drive(colon_folder, scope, capsule, monkeypatch) -> Iterator[Drive]:
    """Two devices under one hand."""
    monkeypatch.setattr(sources, "Painter", _Painter)
    source = Drive([Session(make_vehicle(colon_folder, one)) for one in (scope, capsule)], size=64)
    yield source
    source.close()


def _goes_on(drive: Drive, until: Callable[[], bool], page: dict[str, float] | None = None) -> None:
    end = time.perf_counter() + 10
    while not until():
        assert time.perf_counter() < end
        if page is not None:
            drive.obey("hand", page)
        drive.advance(0.02)
        time.sleep(0.002)


def _at(axis: str, value: float) -> _State:
    state = _State()
    setattr(state, axis, value)
    return state


def test_each_way_of_the_cap_is_a_lever_beyond_its_dead_zone():
    assert not any(shares(_State(y=0.99 * DEAD_ZONE, yaw=-0.99 * DEAD_ZONE)).values())
    half = 0.5 + 0.5 * DEAD_ZONE
    for axis, lever, sign in (
        ("y", "push", 1), ("yaw", "roll", -1), ("roll", "up", -1), ("pitch", "left", -1), ("z", "gas", -1),
    ):  # fmt: skip
        asked = shares(_at(axis, half))
        assert asked.pop(lever) == pytest.approx(sign * 0.5) and not any(asked.values())
        assert shares(_at(axis, -1.3))[lever] == -sign
    assert not any(shares(_State(x=1.0, y=float("nan"))).values())


def test_the_cap_holds_what_it_moves_and_leaves_the_rest_to_the_page(drive):
    device, session = _Fake(), drive.sessions[0]
    with SpaceMouse(drive, device):
        device.hold(y=1.0)
        page, begun = {"left": 1.0}, session.look.row["insertion"]
        _goes_on(drive, lambda: session.hand.share.tolist() == [1, 0, 0, 1, 0, 0], page)
        _goes_on(drive, lambda: session.look.row["insertion"] > begun + 1e-3, page)
        device.hold()
        _goes_on(drive, lambda: session.hand.share.tolist() == [0, 0, 0, 1, 0, 0], page)
        assert not drive.sessions[1].hand.share.any(), "a capsule has none of these levers"
        _goes_on(drive, lambda: not session.hand.share.any())  # the page is not heard of, though the device is there
    assert device.closed and drive.before_step is None


@pytest.mark.parametrize("how", ["silent", "plugged"])
def test_a_silent_or_unplugged_device_has_let_go(how, drive):
    device, hand = _Fake(), drive.sessions[0].hand
    with SpaceMouse(drive, device) as mouse:
        device.hold(y=-1.0, yaw=1.0)
        _goes_on(drive, lambda: hand.share[0] == hand.share[1] == -1.0)
        setattr(device, how, how == "silent")
        _goes_on(drive, lambda: not hand.share.any())
        if how == "silent":
            assert time.perf_counter() - mouse.heard > WATCHDOG
            device.silent = False
            _goes_on(drive, lambda: hand.share[0] == -1.0)
        else:
            assert not mouse.connected


def test_buttons_unlock_knobs_and_call_for_help_once_a_press(drive, monkeypatch):
    device, session = _Fake(), drive.sessions[0]
    said: list[Any] = []
    monkeypatch.setattr(drive, "command", said.append)
    with SpaceMouse(drive, device):
        for buttons in ([1, 0], [0, 0], [0, 1], [0, 0]):
            count = len(said)
            device.hold(buttons=buttons)
            _goes_on(drive, lambda count=count, buttons=buttons: len(said) == count + sum(buttons))
            time.sleep(0.02)
        for message in said:
            for name, value in message.items():
                drive.obey(name, value)
    assert len(said) == 2 and session.assisted
    assert session.hand.locked.tolist() == [True, True, False, False, True, True]


def test_what_is_missing_is_one_line(colon_folder, capsule, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pyspacemouse", None)
    with pytest.raises(MissingDependencyError, match="pip install haustra\\[spacemouse\\]"):
        find_space_mouse()
    call = ["drive", "--colon", str(colon_folder), "--device", "paediatric", "--spacemouse", "--no-browser"]
    assert main(call) == BAD_INPUT
    error = capsys.readouterr().err
    assert "haustra[spacemouse]" in error and error.count("\n") == 1
    assert main([*call, "--haptic", "0"]) == BAD_INPUT
    assert "one hand" in capsys.readouterr().err

    def none(**about: Any) -> Any:
        assert about == {"axis_convention": "z upwards"}
        raise RuntimeError("No connected or supported devices found.")

    library = SimpleNamespace(AxisConvention=SimpleNamespace(HID_Z_UP="z upwards"), open=none)
    monkeypatch.setitem(sys.modules, "pyspacemouse", library)
    with pytest.raises(InvalidOptionError, match="connect one"):
        find_space_mouse()

    def without_library(**about: Any) -> Any:
        raise RuntimeError("HID API is probably not installed.") from AttributeError("hid_enumerate")

    library.open = without_library
    with pytest.raises(MissingDependencyError, match="system's library hidapi"):
        find_space_mouse()
    monkeypatch.setattr(sources, "Painter", _Painter)
    other = Drive([Session(make_vehicle(colon_folder, capsule))], size=64)
    with pytest.raises(UnsupportedSceneError, match="this vehicle has none"):
        SpaceMouse(other, _Fake())
    other.close()
