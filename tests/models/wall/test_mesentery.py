"""How a colon hangs: what is mobile, what is fixed, and how several are stacked."""

from collections.abc import Callable

import numpy as np
import pytest
from runtime_types import unchecked
from scipy.optimize import brentq
from scipy.special import ellipe, ellipj, ellipk

from haustra.assets import asset
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.injury.pain import axis_tensions
from haustra.models.wall import moving_colon
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.mesentery import INDENTED, NODE_SPACING, Mesentery, hang, seen_from, stack
from haustra.models.wall.sections import SHORTEST
from haustra.quantity import load_quantities

_NUMBERS = {name: each.value for name, each in load_quantities(asset("numbers/mesentery.toml")).items()}
_RADIUS = 0.02


def _hung(length: float = 1.2) -> Mesentery:
    arcs = np.linspace(0.0, length, 601)
    borders = np.linspace(0.0, length, len(SEGMENTS) + 1)
    segments = [ColonSegment(name, borders[k], borders[k + 1]) for k, name in enumerate(SEGMENTS)]
    turn = arcs / 0.3
    points = 0.3 * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    return hang(points, arcs, np.full(len(arcs), _RADIUS), segments)


def test_sigmoid_and_transverse_colon_are_mobile_and_the_rest_has_grown_to_the_back_wall() -> None:
    own = _hung()
    share = np.linspace(0.0, 6.0, len(own.nodes))  # segments of equal length
    mobile = own.slack > 0
    assert set(np.floor(share[mobile])) == {1.0, 3.0}
    assert own.slack[np.abs(share - 1.5).argmin()] == pytest.approx(_NUMBERS["mesentery.height.sigmoid"])
    assert own.slack[np.abs(share - 3.5).argmin()] == pytest.approx(_NUMBERS["mesentery.height.transverse"])
    per_length = own.hold[1:] / own.spacing
    mobile = np.isin(np.floor(share[1:]), (1.0, 3.0))
    assert per_length[mobile] == pytest.approx(_NUMBERS["mesentery.stiffness"])
    assert per_length[~mobile] == pytest.approx(_NUMBERS["mesentery.attachment"])
    assert own.hold[0] > _NUMBERS["mesentery.anus"]


def test_a_mesentery_is_shorter_where_it_ends() -> None:
    own = _hung()
    sigmoid = own.slack[(own.slack > 0) & (np.arange(len(own.nodes)) < len(own.nodes) / 2)]
    assert sigmoid[0] < 0.4 * sigmoid.max() > sigmoid[-1]


def test_the_tube_is_that_of_its_modulus_thickness_and_radius() -> None:
    own = _hung()
    expected = _NUMBERS["mesentery.modulus"] * 2 * np.pi * _RADIUS * _NUMBERS["mesentery.thickness.other"]
    assert own.tension[-1] == pytest.approx(expected)
    rigidity = own.bending[-2] * own.spacing
    assert rigidity == pytest.approx(_NUMBERS["mesentery.bending"] * expected * _RADIUS**2 / 2)
    assert own.spacing == pytest.approx(NODE_SPACING, rel=0.05)
    assert own.turns[0] == pytest.approx(0) and own.turns[5] == pytest.approx(own.spacing / 0.3, rel=0.01)


def test_no_bend_has_closed_on_the_wall_at_rest() -> None:
    """Where rays from the axis see past the middle of a bend, they see the wall of another stretch."""
    arcs = np.linspace(0.0, 0.3, 301)
    turn = np.clip((arcs - 0.1) / 0.02, 0.0, np.pi)
    points = np.cumsum(np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) * arcs[1], axis=0)
    own = hang(points, arcs, np.full(len(arcs), _RADIUS), (), widest=np.full(len(arcs), 0.09))
    closed = own.widths * np.linalg.norm(own.closings, axis=1)
    assert closed.max() == pytest.approx(0.9)
    assert own.widths[0] == pytest.approx(0.09 + INDENTED)


def test_without_segments_nothing_is_mobile() -> None:
    arcs = np.linspace(0.0, 0.3, 50)
    own = hang(arcs[:, None] * [0, 0, 1.0], arcs, np.full(50, _RADIUS), ())
    assert not own.slack.any()


def test_a_short_colon_is_filled_up_with_nodes_that_bear_nothing() -> None:
    short, long = _hung(0.8), _hung(1.2)
    both = stack([short, long])
    count = len(short.nodes)
    assert both.nodes.shape == (2, len(long.nodes), 3)
    assert np.array_equal(both.nodes[0, :count], short.nodes)
    assert not both.tension[0, count - 1 :].any() and not both.bending[0, count:].any()
    assert (both.hold[0, count:] > 0).all() and (both.drag[0] > 0).all()
    assert np.isfinite(np.concatenate([part.ravel() for part in both])).all()


def test_it_looks_the_same_from_elsewhere() -> None:
    own = _hung()
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    other = seen_from(own, np.array([0.1, 0.2, 0.3]), turn)
    assert np.linalg.norm(np.diff(other.nodes, axis=0), axis=1) == pytest.approx(own.lengths)
    assert other.tangents @ turn.T == pytest.approx(own.tangents)


def _loop(abdomen: Abdomen) -> Mesentery:
    """A sigmoid that bows aside by 0.12 m between ends that are 0.24 m apart."""
    turns = np.linspace(0.0, np.pi, 400)
    points = 0.12 * np.column_stack([1 - np.cos(turns), 0 * turns, np.sin(turns)])
    whole = 0.12 * np.pi
    return hang(points, 0.12 * turns, np.full(400, _RADIUS), [ColonSegment("sigmoid", 0.0, whole)], abdomen=abdomen)


def test_a_loop_may_be_straightened_onto_the_root_of_its_mesentery() -> None:
    """And be pushed as far out as without one: both tensions are 7 kN/m^2 a millimetre beyond the mesentery's height.

    Where mesenteries hang from where the colon was imaged, straightening draws on them by what a loop is higher.
    """
    rooted, imaged = _loop(Abdomen(rooted=True)), _loop(Abdomen())
    middle = len(rooted.nodes) // 2
    root = rooted.nodes[middle] - rooted.root[middle]
    assert rooted.rooted and not imaged.rooted
    assert root == pytest.approx((rooted.nodes[0] + rooted.nodes[-1]) / 2, abs=float(rooted.spacing))
    height = imaged.slack[middle]
    out = rooted.root[middle] / np.linalg.norm(rooted.root[middle])
    for own, straightened in ((rooted, 0.0), (imaged, _NUMBERS["mesentery.stiffness"] * (0.12 - height))):
        placed = np.zeros((1, len(own.nodes), 7))
        placed[0, middle, :3] = root - own.nodes[middle]
        held = axis_tensions(np, own, placed, np.full(len(own.nodes), _RADIUS))[1][0, middle]
        assert held == pytest.approx(straightened, rel=0.3, abs=1e-3)
        placed[0, middle, :3] = (height + 0.001) * out
        held = axis_tensions(np, own, placed, np.full(len(own.nodes), _RADIUS))[1][0, middle]
        around = 0.0 if own.rooted else _NUMBERS["mesentery.support"] * (height + 0.001)
        assert held == pytest.approx(_NUMBERS["mesentery.stiffness"] * 0.001 + around, rel=1e-6)


def test_a_colon_that_hangs_from_its_root_is_at_rest_where_it_was_imaged() -> None:
    own = stack([_loop(Abdomen(rooted=True))])
    still = moving_colon.at_rest(np, own, 1, float)
    none = np.zeros((1, own.nodes.shape[1], 3, 3))
    with unchecked():
        force, _ = moving_colon.spring_forces(np, own, still.pose, none)
    assert np.abs(force).max() < 1e-6


def _elastica(k: float) -> tuple[np.ndarray, float, float]:
    """A fold of arc 1 and modulus k: curvature evenly over its arc, length from end to end, and height."""
    along = np.linspace(0.0, 1.0, 2001)
    sine, cosine, _, _ = ellipj(4 * ellipk(k * k) * along, k * k)
    turned = np.sin(2 * np.arcsin(k * sine))
    risen = np.concatenate([[0.0], np.cumsum((turned[1:] + turned[:-1]) / 2) / 2000])
    return 8 * k * ellipk(k * k) * cosine, float(2 * ellipe(k * k) / ellipk(k * k) - 1), float(np.ptp(risen))


def _fold(above: Callable[[float, float], float]) -> tuple[np.ndarray, float]:
    """Curvature and length of the fold where what is asked of its length and height crosses 0."""
    found = float(brentq(lambda k: above(*_elastica(k)[1:]), 1e-9, 0.9))  # type: ignore[arg-type]
    return _elastica(found)[:2]


def _pleating(thickness: float, spacing: float, height: float) -> float:
    """Stiffness over that in tension of a spring that takes folds' work until they touch, by Ritz's bound."""
    rest, share = _fold(lambda length, high: high / length - height / spacing)
    shut, _ = _fold(lambda length, _: SHORTEST * share - length)
    arc = spacing / share
    work = 0.5 * thickness**2 / 9 * np.mean((shut - rest) ** 2) / arc / spacing  # over E t, per length at rest
    return float(2 * work / (1 - SHORTEST) ** 2)


def test_pleating_is_what_folds_of_the_wall_resist() -> None:
    quantity = load_quantities(asset("numbers/mesentery.toml"))["mesentery.pleating"]
    assert _pleating(0.0025, 0.019, 1e-6) == pytest.approx(quantity.high, rel=0.05)
    assert _pleating(0.001, 0.05, 0.007) == pytest.approx(quantity.low, rel=0.1)
