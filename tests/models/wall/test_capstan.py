"""A rope drawn round the inside of a colon's bend, against tangent planes, resists as the capstan equation says."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Centreline, Colon
from haustra.models.anatomy.tube import tube
from haustra.models.wall.law import WallContact
from haustra.models.wall.planes import PlaneWall, Sample, add_planes
from haustra.models.wall.signed_distance import LumenDistance
from haustra.scripts.bench.accuracy.capstan import DRUM, ROPE, Drawn, bent_rope, drawn_rope
from tests.tube_colon import RADIUS, straight_tube

LEG = 0.12
"""Straight colon on either side of the bend [m], so that the rope is clear of both ends."""
ANGLES = 48


def bend_round(turn: float) -> Colon:
    """A tube whose inner side lies round the y axis, as the drum does, through an angle `turn` [rad]."""
    bend = DRUM + RADIUS
    length = 2 * LEG + bend * turn
    arc = np.linspace(0.0, length, round(length / 0.002) + 1)
    angle = np.clip((arc - LEG) / bend, 0.0, turn)
    tangent = np.column_stack([-np.cos(angle), np.zeros(len(arc)), -np.sin(angle)])
    out = np.column_stack([-np.sin(angle), np.zeros(len(arc)), np.cos(angle)])
    straight = np.minimum(arc - LEG, 0.0) + np.maximum(arc - LEG - bend * turn, 0.0)
    points = bend * out + straight[:, None] * tangent
    sideways = np.tile([0.0, 1.0, 0.0], (len(arc), 1))
    frames = np.stack([sideways, np.cross(tangent, sideways), tangent], axis=2)
    radius = np.full((len(arc), ANGLES), RADIUS)
    return replace(
        straight_tube(length),
        lumen=tube(points, frames, radius),
        centreline=Centreline(points=points, arc=arc, frames=frames),
        radius=radius,
    )


def rope_in_a_bend(turn: float, friction: float, radius: float) -> Drawn:
    """Draw a rope without stiffness along a colon's bend whose wall is tangent planes."""
    colon, contact = bend_round(turn), WallContact(stiffness=1500.0, damping=7.5, friction=friction)
    spec, balls, last = bent_rope(turn, radius=radius)
    bare = spec.compile()
    samples = [Sample(name.replace("ball", "link"), np.zeros(3), radius) for name in balls]
    add_planes(spec, bare, samples, contact, timestep=bare.opt.timestep)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    centres = np.array([data.body(sample.body).xpos for sample in samples])
    arcs = colon.centreline.arc[KDTree(colon.centreline.points).query(centres)[1]]
    return drawn_rope(model, last, before=PlaneWall(model, LumenDistance(colon), arcs=arcs).update)


@pytest.mark.parametrize(
    ("turn", "friction", "radius"),
    [(np.pi / 2, 0.1, ROPE), (np.pi / 2, 0.3, ROPE), (np.pi, 0.1, ROPE), (np.pi, 0.3, 0.0005)],
)
def test_a_rope_round_the_inside_of_a_bend_follows_the_capstan_equation(turn, friction, radius):
    assert rope_in_a_bend(turn, friction, radius).ratio == pytest.approx(np.exp(friction * turn), rel=0.03)


@pytest.mark.parametrize(("turn", "friction"), [(np.pi / 2, 0.3), (np.pi, 0.3)])
def test_a_thick_rope_resists_less_since_friction_acts_beside_its_line(turn, friction):
    """Balance of moments about the bend's middle: friction has the lever of the wall, the pull that of the rope's line.

    To the first order in their ratio the exponent is smaller by it: half a turn at 0.3 is 5.7 % off e^(mu theta).
    """
    thick = np.exp(friction * turn * DRUM / (DRUM + ROPE))
    assert rope_in_a_bend(turn, friction, ROPE).ratio == pytest.approx(thick, rel=0.01)
