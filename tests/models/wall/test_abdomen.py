"""Postures, mobile segments, adhesions and a hand: what hangs, sags and is pressed, against statics."""

import numpy as np
import pytest

from haustra.assets import asset
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall import mesentery
from haustra.models.wall.abdomen import DOWN, Abdomen, turned_weight
from haustra.models.wall.mesentery import Mesentery, hang
from haustra.models.wall.surroundings import SIDES
from haustra.quantity import load_quantities
from tests.models.wall.quickly import crept
from tests.tube_colon import straight_tube

_NAMES = "rectum", "sigmoid", "descending", "transverse", "ascending", "caecum"
_NUMBERS = {name: each.value for name, each in load_quantities(asset("numbers/mesentery.toml")).items()}
_STEP = 0.1
"""Balance does not depend on it [s]."""


def _hung(abdomen: Abdomen | None = None) -> Mesentery:
    arcs = np.linspace(0.0, 1.2, 400)
    segments = [ColonSegment(name, 0.2 * row, 0.2 * (row + 1)) for row, name in enumerate(_NAMES)]
    return hang(arcs[:, None] * [0.0, 0.0, 1.0], arcs, np.full(400, 0.02), segments, abdomen=abdomen)


def _settled(own: Mesentery, steps: int = 300) -> np.ndarray:
    """Displacements of the nodes once nothing moves any more [m]."""
    return crept(mesentery.stack([own]), steps, _STEP)


def test_a_colon_lies_as_it_was_imaged_on_the_back() -> None:
    assert not _hung().load.any()
    assert not _hung(Abdomen(posture="supine")).load.any()
    assert np.abs(_settled(_hung(), 10)).max() < 1e-8


@pytest.mark.parametrize(
    "posture",
    ["prone", pytest.param("left", marks=pytest.mark.thorough), pytest.param("right", marks=pytest.mark.thorough)],
)
def test_a_hanging_chain_sags_as_statics_says(posture: str) -> None:
    """Two held ends and a weight per length w: the tension's component along it times the sag is w L^2 / 8."""
    length, count, weight = 0.2, 21, 3.0
    z = np.linspace(0.0, length, count)
    own = hang(z[:, None] * [0.0, 0.0, 1.0], z, np.full(count, 0.02), ())
    loads = turned_weight(posture, np.full(count, weight * length / (count - 1)))
    pull = np.linalg.norm(loads[0])
    held = np.zeros(count)
    held[[0, -1]] = 1e6
    free = np.zeros(count)
    own = own._replace(hold=held, support=free, bending=free, upright=free, drag=np.full(count, 0.02), load=loads)
    own = own._replace(tension=np.full(count - 1, 300.0))
    moved = _settled(own, 1500)
    down = loads[0] / pull
    sag = moved @ down
    assert np.abs(moved - np.outer(sag, down))[:, :2].max() < 1e-9
    ways = np.diff(own.nodes + moved, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    along = 300.0 * (lengths / own.lengths - 1) * ways[:, 2] / lengths
    across = pull / (length / (count - 1))
    assert along == pytest.approx(np.full(count - 1, along.mean()), rel=1e-3)
    assert along.mean() * sag.max() == pytest.approx(across * length**2 / 8, rel=0.01)


def test_segments_are_mobile_adherent_and_pressed_where_they_are_said_to_be() -> None:
    plain, own = (
        _hung(),
        _hung(Abdomen(mobile=("descending",), adhesions=("transverse",), pressed="sigmoid", hand=20.0)),
    )
    arcs = np.arange(len(own.nodes)) * float(own.spacing)
    inside = {name: (arcs > 0.2 * row + 0.05) & (arcs < 0.2 * row + 0.15) for row, name in enumerate(_NAMES)}
    assert (plain.slack[inside["descending"]] == 0).all() and (own.slack[inside["descending"]] > 0.03).all()
    assert (own.slack[inside["ascending"]] == 0).all()
    middle = np.abs(arcs - 0.7) < 0.03
    assert (plain.slack[middle] > 0).all() and (own.slack[middle] == 0).all()
    front = own.room[:, SIDES.index("front")]
    assert -(np.minimum(front, 0.0) * own.walls[0]).sum() == pytest.approx(20.0)
    assert (front[inside["sigmoid"]] < 0).any() and not (front[inside["descending"]] < 0).any()
    assert _settled(own, 100)[np.abs(arcs - 0.3) < 0.03, 1].min() > 0.03


def test_a_hand_goes_no_deeper_than_the_belly_that_bears_it() -> None:
    """A belly of 5 kN/m^2 bears 20 N over 8 cm when it is pressed in by 5 cm; beyond, a hand presses on nothing.

    A force that goes on however far the colon has gone would draw the mesentery taut, and fold what a scope lies in.
    """
    own = _hung(Abdomen(pressed="sigmoid", hand=20.0))
    middle = np.abs(np.arange(len(own.nodes)) * float(own.spacing) - 0.3) < 0.03
    depth = 20.0 / (_NUMBERS["mesentery.envelope.front"] * _NUMBERS["mesentery.grip"])
    free = np.zeros(len(own.nodes))
    limp = own._replace(hold=free, support=free, bending=free, upright=free, tension=1e-3 * own.tension)
    for hung in (own, limp):
        moved = _settled(hung, 600)[middle, 1]
        assert 0.03 < moved.min() <= moved.max() < 1.15 * depth


def test_what_is_off_is_named_and_a_tube_without_torsion_has_none() -> None:
    around = {"envelope": True, "breathing": True, "rooted": True, "loops_touch": True}
    on = Abdomen("left", ("ascending",), ("sigmoid",), "sigmoid", **around)
    assert on.left_out() == {} and not _hung(Abdomen(torsion=False)).torsion.any() and (_hung().torsion > 0).all()
    scene = build_scene(straight_tube(), None, named_design("adult"), SceneOptions(wall_law="table", mesentery=True))
    off = {"loops of colon against each other", "breathing", "adhesions", "a hand on the belly"}
    off |= {"abdominal wall and organs around", "mobile descending and ascending colon", "roots of mesenteries"}
    assert off == set(Abdomen().left_out()) and off <= set(scene.left_out)
    assert set(Abdomen(torsion=False).left_out()) - off == {"torsion of the colon"}


def test_what_is_no_posture_or_segment_is_refused() -> None:
    with pytest.raises(InvalidOptionError, match="mobile names sigmoid"):
        Abdomen(mobile=("sigmoid",))
    with pytest.raises(InvalidOptionError, match="need a colon that moves"):
        SceneOptions(wall_law="table", abdomen=Abdomen(posture="left"))
    assert all(np.linalg.norm(down) == 1.0 for down in DOWN.values())
