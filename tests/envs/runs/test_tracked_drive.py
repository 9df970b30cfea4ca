"""The tracked robot at 1:1 in colons that are neither round nor straight."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.tracked_drive import Drive, drive_in_colon, settled
from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.mesh_colon import import_colon
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.drive import worm_lever
from haustra.models.wall.pieces.wall import Wall, WallPiece
from tests.ring_wall import bent_colon, ring_wall
from tests.tube_colon import straight_tube, wedge_wall

DESIGN = TrackedDesign().at_scale(1.0)
SPEED = DESIGN.tread_speed(150)
FRICTION = 0.4
START = 0.03


def stretch(colon: Colon, low: float, high: float) -> Colon:
    """Only these arc lengths [m], so that a wall is quick to build; the lumen stays whole."""
    line = colon.centreline
    kept = (line.arc >= low) & (line.arc <= high)
    arc = line.arc[kept] - line.arc[kept][0]
    return replace(
        colon,
        centreline=Centreline(line.points[kept], arc, line.frames[kept]),
        radius=colon.radius[kept],
        segments=(ColonSegment("sigmoid", 0.0, float(arc[-1])),),
    )


def drive(colon: Colon, wall: Wall, *, held: bool = False, steered: bool = False, seconds: float = 1.5) -> Drive:
    return drive_in_colon(
        colon,
        wall,
        DESIGN,
        arc=START,
        friction=FRICTION,
        speed=SPEED,
        seconds=seconds,
        held=held,
        steered=steered,
    )


def check_drives_and_pulls(colon: Colon, wall: Wall, least_share: float) -> None:
    """It moves with its treads, presses with every track, and pulls next to mu sum N when held."""
    free, held = drive(colon, wall), drive(colon, wall, held=True)
    assert {free.outcome, held.outcome} == {"completed"}
    assert free.ended_by == "time"
    driven = free.arc[-1] - free.arc[0]
    assert least_share * 1.5 * SPEED <= driven + 0.002 <= 1.1 * 1.5 * SPEED + 0.004  # stations are 2 mm apart
    assert (free.normal[settled(free)].mean(0) > 0.02).all()
    assert free.normal[settled(free)].max() < 2.0
    pulled, pressed = held.leash[settled(held)].mean(), held.normal[settled(held)].sum(1).mean()
    assert 0.6 * FRICTION * pressed < pulled < 1.05 * FRICTION * pressed
    assert np.linalg.norm(held.core[-1] - held.core[0]) < 2e-3


def test_it_drives_and_pulls_in_a_grown_colon() -> None:
    colon = stretch(grow_colon(seed=0), 0.36, 0.45)
    check_drives_and_pulls(colon, ring_wall(colon), 0.7)


@pytest.mark.parametrize("steered", [False, True])
def test_it_drives_round_a_bend_at_nearly_its_tread_speed(steered: bool) -> None:
    """90 degrees at a radius of 40 mm, where treads that touch at their tips only would stand."""
    colon = bent_colon(bend=0.04, leg=0.045, length=0.17)
    run = drive(colon, ring_wall(colon), steered=steered, seconds=10.0)
    assert run.ended_by == "time"
    assert run.arc[-1] - run.arc[0] > 0.8 * 10.0 * SPEED
    assert run.axis @ [1, 0, 0] > 0.7
    assert run.core_force.max() < 1.0


def test_it_says_what_stopped_it() -> None:
    """A plug across the lumen: its core pushes against it."""
    corners = np.array([[x, y, z] for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (0.07, 0.08)])
    plug = WallPiece(vertices=corners, start=0.07, end=0.08)
    colon = bent_colon(bend=0.04)
    wall = ring_wall(colon)
    run = drive(colon, replace(wall, pieces=(*wall.pieces, plug)), seconds=8.0)
    assert run.ended_by == "blocked"
    assert run.arc[-1] < 0.07
    assert run.time[-1] < 7.0


@pytest.mark.slow
def test_it_drives_in_a_real_colon(shared_data: Path) -> None:
    colon = import_colon(shared_data / "colons" / "EdinGCA_3D_00020_lumen_mm.stl", units="mm")
    # Bent by 17 degrees only: where walls lean towards the robot, as in bends, they push it along as well.
    part = stretch(colon, 0.305, 0.385)
    check_drives_and_pulls(part, ring_wall(part), 0.6)


def test_a_step_beyond_stability_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    design = TrackedDesign().at_scale(1.1)  # reaches the wall of a 40 mm tube
    run = drive_in_colon(
        straight_tube(), wedge_wall(), design, arc=0.3, friction=FRICTION, speed=SPEED, seconds=2.0, timestep=0.02
    )
    assert run.outcome == "diverged"
    assert not list(tmp_path.iterdir())


def test_its_worms_torque_turns_it_and_its_limit_holds_it_back() -> None:
    """t = F lead / (2 pi eta) in the worm and on the core; what the shaft may transmit bounds the pull at a string."""
    colon = bent_colon(bend=0.04)
    wall = ring_wall(colon)
    strong = drive(colon, wall, held=True, seconds=2.0)
    lever = worm_lever(DESIGN)
    pulled = strong.leash[settled(strong)].mean()
    torque = strong.worm_torque[len(strong.worm_torque) // 2 :].mean()
    assert torque == pytest.approx(pulled * lever, rel=0.15)
    assert (strong.worm_share == 1).all() and torque < DESIGN.worm.torque_limit
    weak = replace(DESIGN, worm=replace(DESIGN.worm, torque_limit=0.5 * pulled * lever))
    run = drive_in_colon(colon, wall, weak, arc=START, friction=FRICTION, speed=SPEED, seconds=2.0, held=True)
    assert run.worm_share[-1] < 0.2
    # Asked once a control interval: the string gains this much until the worm stands, and being self-locking it holds.
    late = 500.0 * SPEED * 0.02
    assert 0.45 * pulled < run.leash[-200:].mean() < 0.5 * pulled + late
