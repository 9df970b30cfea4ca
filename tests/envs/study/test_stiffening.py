"""A stiffening ring is turned once the shaft was straightened in a segment or beyond, and stays turned."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from haustra.envs.control.endoscopist import FIRST_MEMORY
from haustra.envs.study.stiffening import StiffeningRing
from tests.tube_colon import straight_tube


def _batch(given: list) -> Any:
    """Worlds whose tips are where the test says, and what they are given."""
    backend = SimpleNamespace(give=lambda name, values: given.append((name, values)))
    batch = SimpleNamespace(backend=backend, arcs=np.zeros(2), driver_numbers=lambda: None)
    batch.memory = None
    tally = lambda numbers: SimpleNamespace(tip_arc_max=batch.arcs)  # noqa: E731
    batch.program = SimpleNamespace(tally_of=tally, memory_of=lambda numbers: batch.memory)
    return batch


def test_the_ring_is_turned_where_the_tip_comes_to_the_segment() -> None:
    """The tube's sigmoid begins at 0.3 m; nothing is given twice."""
    given: list = []
    batch = _batch(given)
    ring = StiffeningRing(batch, [straight_tube()] * 2, segment="sigmoid")
    ring()
    assert given == []
    batch.arcs = np.array([0.31, 0.2])
    ring()
    ring()
    assert len(given) == 1 and given[0][0] == "ring"
    assert given[0][1].tolist() == [1.0, 0.0]
    batch.arcs = np.array([0.1, 0.5])
    ring()
    assert given[-1][1].tolist() == [1.0, 1.0]


def test_an_endoscopist_stiffens_what_is_straightened() -> None:
    """Neither where the tip comes, nor while the shaft is drawn straight, nor for a pull-back before."""
    given: list = []
    batch = _batch(given)
    ring = StiffeningRing(batch, [straight_tube()], segment="sigmoid")
    for arc, mode, turned in ((0.2, 1, 0), (0.31, 2, 0), (0.35, 0, 0), (0.35, 1, 0), (0.33, 2, 1), (0.4, 1, 1)):
        batch.arcs, batch.memory = np.array([arc]), FIRST_MEMORY._replace(mode=np.array([float(mode)]))
        ring()
        assert len(given) == turned
    assert given[0][1].tolist() == [1.0]


def test_a_ring_that_nobody_turns_gives_nothing() -> None:
    given: list = []
    batch = _batch(given)
    ring = StiffeningRing(batch, [straight_tube()] * 2, segment="never")
    batch.arcs = np.full(2, 9.0)
    ring()
    assert given == []
