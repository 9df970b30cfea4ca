"""One rule for one world and for many, in numpy and in JAX."""

from typing import NamedTuple

import numpy as np
import pytest

from haustra.envs.control import follower
from haustra.envs.control.follower import FollowerSettings, Memory, Steering
from haustra.models.devices.scope.library import named_design

WORLDS, TIP_LINKS, INTERVAL = 64, 3, 0.02


class _Seen(NamedTuple):
    insertion: np.ndarray
    roll: np.ndarray
    hand_lead: np.ndarray
    tip: np.ndarray
    tip_frame: np.ndarray
    bend: np.ndarray
    push_force: np.ndarray
    torque: np.ndarray
    link_forces: np.ndarray


def _readings(random: np.random.Generator) -> tuple[_Seen, np.ndarray, np.ndarray]:
    """Readings of scopes that advance, jam and slip; arc lengths of their tips; places ahead of them."""
    frames = np.linalg.qr(random.normal(size=(WORLDS, 3, 3)))[0]
    insertion = random.uniform(0.1, 1.0, WORLDS)
    seen = _Seen(
        insertion=insertion,
        roll=random.normal(size=WORLDS),
        hand_lead=random.uniform(-0.01, 0.01, WORLDS),
        tip=random.normal(size=(WORLDS, 3)),
        tip_frame=frames,
        bend=random.normal(size=(WORLDS, 2)),
        push_force=random.uniform(-20, 45, WORLDS),
        torque=np.zeros(WORLDS),
        link_forces=random.uniform(0, 15, (WORLDS, 12)),
    )
    return seen, insertion - random.uniform(-0.02, 0.2, WORLDS), random.normal(size=(WORLDS, 3))


def _driven(xp, settings: FollowerSettings, worlds: slice, kind) -> list[np.ndarray]:
    """Controls of forty decisions in some of the worlds."""
    random, memory = np.random.default_rng(0), None
    steering, asked = Steering.of(named_design("adult"), settings), []
    for step in range(40):
        seen, arc, target = _readings(random)
        seen = _Seen(*(xp.asarray(part[worlds]) for part in seen))
        count = len(seen.roll)
        memory = memory or settings.law().begin(xp, count, kind)
        decision, memory = follower.decide(
            xp,
            settings,
            steering,
            seen,
            memory,
            time=xp.full(count, 0.4 * step),
            arc=xp.asarray(arc[worlds]),
            target=xp.asarray(target[worlds]),
            interval=INTERVAL,
            tip_links=TIP_LINKS,
        )
        asked.append(np.column_stack([np.asarray(part).reshape(count, -1) for part in decision]))
    assert isinstance(memory, Memory)
    return asked


@pytest.mark.parametrize("straighten", [False, True])
def test_a_world_is_driven_the_same_alone_and_among_others(straighten: bool) -> None:
    settings = FollowerSettings(straighten=straighten)
    among = np.array(_driven(np, settings, slice(None), np.float64))
    alone = np.array(_driven(np, settings, slice(5, 6), np.float64))
    assert np.array_equal(among[:, 5:6], alone)
    assert (among[..., 0] < 0).any() and (among[..., 0] > 0).any(), "they retreat and advance"


@pytest.mark.parametrize("straighten", [False, True])
def test_jax_decides_as_numpy_does(straighten: bool) -> None:
    jax = pytest.importorskip("jax")
    settings = FollowerSettings(straighten=straighten)
    known = np.array(_driven(np, settings, slice(None), np.float64))
    with jax.enable_x64(True):
        found = np.array(_driven(jax.numpy, settings, slice(None), np.float64))
    assert found == pytest.approx(known, abs=1e-9)


def test_bends_stay_within_what_the_design_can_do() -> None:
    """Pulls of opposite wires never act together, and none exceeds the wire's limit."""
    design = named_design("adult")
    pulls = np.array(_driven(np, FollowerSettings(), slice(None), np.float64))[..., 2:]
    assert (pulls.min(axis=-1) == 0).all() and (pulls[..., :2] * pulls[..., 2:] == 0).all()
    assert pulls.max() <= design.wires.pull_limit
