"""Loops on shapes made to have them."""

from itertools import pairwise

import numpy as np
import pytest

from haustra.envs.runs.measure.crossings import crossings
from haustra.envs.runs.measure.loops import LoopKind, Rest, find_loops, writhe
from haustra.errors import InvalidOptionError

VIEW = np.array([0.0, 1.0, 0.0])


def curl(handed: float, turns: float = 1.0) -> np.ndarray:
    """Straight, then a coil about z of the given handedness, then straight on; looked at across the coil's axis."""
    s = np.linspace(0, 1, 120)
    coil = 0.06 * np.stack([np.sin(2 * np.pi * turns * s), handed * (1 - np.cos(2 * np.pi * turns * s)), 0 * s], axis=1)
    coil[:, 2] += 0.03 * s
    before = np.stack([np.linspace(-0.3, 0, 30), np.zeros(30), np.zeros(30)], axis=1)[:-1]
    after = coil[-1] + np.stack([np.linspace(0, 0.3, 30), np.zeros(30), np.zeros(30)], axis=1)[1:]
    return np.vstack([before, coil, after])


@pytest.mark.parametrize("view", [[0, 0, 1.0], [0, 0, -2.0], [0.2, 0.1, 1.0]])
@pytest.mark.parametrize(("handed", "kind"), [(1.0, LoopKind.ALPHA), (-1.0, LoopKind.REVERSED_ALPHA)])
def test_the_crossing_tells_alpha_from_reversed_alpha_from_any_side(handed, kind, view):
    """A curve that turns anticlockwise about z while it climbs along z is a right-handed coil."""
    (loop,) = find_loops(curl(handed), view=np.array(view))
    assert loop.kind is kind
    assert loop.end - loop.start == pytest.approx(2 * np.pi * 0.06, rel=0.15)
    assert loop.size == pytest.approx(0.12, rel=0.1)
    assert np.sign(writhe(curl(handed))) == handed


def test_many_crossings_are_all_found():
    """A curve that winds outwards for 4.7 turns and then comes straight back crosses itself four times."""
    s = np.linspace(0, 4.7, 400)
    coil = np.stack([(0.05 + 0.01 * s) * np.cos(2 * np.pi * s), (0.05 + 0.01 * s) * np.sin(2 * np.pi * s)], axis=1)
    inwards = np.linspace(coil[-1], 0.2 * coil[-1], 30)[1:]
    flat = np.vstack([coil, inwards])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(flat, axis=0), axis=1))])
    found = crossings(flat, np.where(np.arange(len(flat)) < 400, 0.0, 0.01), arc)
    assert len(found) == 4
    assert {sign for *_, sign in found} in ({1.0}, {-1.0})


def test_a_crossing_in_the_transverse_colon_is_gamma():
    regions = {"sigmoid": (0.0, 0.2), "transverse": (0.25, 0.8)}
    (loop,) = find_loops(curl(1.0), view=np.array([0, 0, 1.0]), regions=regions)
    assert loop.kind is LoopKind.GAMMA


def test_an_n_bows_one_way_and_back():
    s = np.linspace(0, 1, 200)
    heading = 1.5 * np.sin(2 * np.pi * s) + 0.0
    path = 0.4 * np.cumsum(np.stack([np.cos(heading), 0 * s, np.sin(heading)], axis=1), axis=0) / 200
    (loop,) = find_loops(path, view=VIEW)
    assert loop.kind is LoopKind.N


@pytest.mark.parametrize("bend", [0.0, 0.5, 2.0])
def test_straight_and_simply_bent_scopes_have_no_loop(bend):
    s = np.linspace(0, 1, 100)
    path = 0.5 * np.cumsum(np.stack([np.cos(bend * s), 0 * s, np.sin(bend * s)], axis=1), axis=0) / 100
    assert find_loops(path, view=VIEW) == ()
    assert abs(writhe(path)) < 1e-6


def test_writhe_of_a_helix():
    """Each further turn of a helix with pitch angle a adds 1 - sin(a), whatever its ends add."""

    def turned(turns: int) -> float:
        s = np.linspace(0, 2 * np.pi * turns, 60 * turns)
        return writhe(np.stack([0.05 * np.cos(s), 0.05 * np.sin(s), 0.1 * s / (2 * np.pi)], axis=1))

    assert (turned(12) - turned(6)) / 6 == pytest.approx(1 - 0.1 / np.hypot(0.1, 2 * np.pi * 0.05), rel=0.01)


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_writhe_does_not_depend_on_how_finely_a_curve_is_cut(handed):
    line = curl(handed)[::6]
    fine = np.vstack([np.linspace(a, b, 5)[:-1] for a, b in pairwise(line)] + [line[-1:]])
    assert writhe(fine) == pytest.approx(writhe(line), abs=1e-9)
    assert handed * writhe(line) == pytest.approx(0.85, abs=0.15)


def test_strands_that_weave_are_no_loop():
    """A coil seen along its axis lies over itself: its crossings there come to at most one loop."""
    s = np.linspace(0, 2.6 * np.pi, 40)
    wobble = 0.004 * np.sin(9 * s)
    coil = np.stack([(0.1 + wobble) * np.cos(s), (0.1 + wobble) * np.sin(s), 0.02 * s], axis=1)
    assert len(find_loops(coil, view=np.array([0.0, 0.0, 1.0]))) <= 1


def test_two_loops_are_counted_apart():
    two = np.vstack([curl(1.0), curl(-1.0)[1:] + curl(1.0)[-1] - curl(-1.0)[0]])
    kinds = [loop.kind for loop in find_loops(two, view=np.array([0, 0, 1.0]))]
    assert kinds == [LoopKind.ALPHA, LoopKind.REVERSED_ALPHA]


def test_what_is_no_shape_is_refused():
    with pytest.raises(InvalidOptionError, match="four finite points"):
        find_loops(np.zeros((3, 3)), view=VIEW)
    with pytest.raises(InvalidOptionError, match="direction"):
        find_loops(curl(1.0), view=np.zeros(3))


def at_rest(line: np.ndarray) -> Rest:
    """A colon whose axis at rest is that line, as a scope on it meets it."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return Rest(line, arc, arc)


@pytest.mark.parametrize("handed", [1.0, -1.0])
def test_a_scope_laid_on_a_coiled_colon_has_no_loop(handed):
    """Null test: what was not pushed made no loop, whatever the colon's own course; the form alone would be one."""
    line, view = curl(handed), np.array([0, 0, 1.0])
    assert len(find_loops(line, view=view)) == 1
    assert find_loops(line, view=view, rest=at_rest(line)) == ()
    inside_the_lumen = line + np.array([0.0, 0.0, 0.02])
    assert find_loops(inside_the_lumen, view=view, rest=at_rest(line)) == ()


def test_a_loop_that_the_push_made_or_enlarged_counts():
    view, loop = np.array([0, 0, 1.0]), curl(1.0)
    straight = np.column_stack([np.linspace(loop[0, 0], loop[-1, 0], len(loop)), np.zeros((len(loop), 2))])
    rest = at_rest(straight)
    spread = Rest(rest.points, rest.arc, np.linspace(0.0, rest.arc[-1], len(loop)))
    assert [each.kind for each in find_loops(loop, view=view, rest=spread)] == [LoopKind.ALPHA]
    wider = np.vstack([loop[:29], 2.0 * loop[29:149], loop[149:] + loop[148]])
    assert find_loops(loop, view=view, rest=at_rest(loop)) == ()
    grown = at_rest(loop)
    assert [each.kind for each in find_loops(wider, view=view, rest=grown)] == [LoopKind.ALPHA]


def test_an_n_ends_with_the_descending_colon():
    """A scope up the left side, across and down the right bows one way and back, and is straight to an endoscopist."""
    s = np.linspace(0, 1, 200)
    heading = 1.5 * np.sin(2 * np.pi * s)
    path = 0.4 * np.cumsum(np.stack([np.cos(heading), 0 * s, np.sin(heading)], axis=1), axis=0) / 200
    assert len(find_loops(path, view=VIEW)) == 1
    assert find_loops(path, view=VIEW, regions={"descending": (0.05, 0.15), "transverse": (0.15, 0.4)}) == ()


def test_a_transverse_colon_pushed_down_is_a_deep_loop():
    s = np.linspace(0, 1, 60)

    def hanging(depth: float) -> np.ndarray:
        return np.stack([0.3 * s, 0 * s, -depth * np.sin(np.pi * s)], axis=1)

    regions, down, rest = {"transverse": (0.0, 1.0)}, np.array([0, 0, -1.0]), at_rest(hanging(0.06))
    deep = Rest(rest.points, rest.arc, np.linspace(0, rest.arc[-1], 60))
    assert find_loops(hanging(0.06), view=VIEW, regions=regions, down=down) == ()
    (loop,) = find_loops(hanging(0.16), view=VIEW, regions=regions, down=down, rest=deep)
    assert loop.kind is LoopKind.DEEP_TRANSVERSE
    own = at_rest(hanging(0.16))
    assert find_loops(hanging(0.16), view=VIEW, regions=regions, down=down, rest=own) == ()
