"""A block that crashes or hangs its child costs that block only."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from haustra.models.wall.pieces import pool
from haustra.models.wall.pieces.blocks import cut_blocks, lumen_solid
from haustra.models.wall.pieces.cells import place_sites, power_cells
from haustra.models.wall.pieces.packing import pack_block, unpack, unpack_block, unpack_hulls


@pytest.fixture(scope="module")
def packed(tube_colon):
    cell = list(power_cells(place_sites(tube_colon, spacing=0.02), thickness=0.03))[3]
    blocks = cut_blocks(cell, lumen_solid(tube_colon, widening=0.0, simplification=1e-4), sectors=8, thickness=0.03)
    return [pack_block(block) for block in blocks]


def _run(blocks, *, limit=60.0):
    answers = {}
    pool.run_blocks(blocks, method="prism", tolerance=0.0015, workers=2, limit=limit, done=answers.__setitem__)
    return answers


def test_packing_keeps_the_block(packed):
    before, after = unpack(packed[0]), unpack(pack_block(unpack_block(packed[0])))
    for name in ("planes", "site"):
        np.testing.assert_array_equal(after[name], before[name])
    solid = unpack_block(packed[0]).solid
    assert solid.volume() > 0
    assert len(after["faces"]) == solid.num_tri()


def test_a_block_that_crashes_its_child_is_reported_and_the_rest_is_done(packed):
    answers = _run([packed[0], b"no block", packed[1], b"", packed[2]])
    assert sorted(answers) == [0, 1, 2, 3, 4]
    assert answers[1] is None
    assert answers[3] is None
    assert all(len(unpack_hulls(answers[index])) >= 1 for index in (0, 2, 4))


def test_blocks_keep_their_order_but_for_the_largest_of_some(packed, monkeypatch):
    monkeypatch.setattr(pool, "TOGETHER", 2)
    ordered = sorted(packed[:4], key=len)  # of each two, the second is the larger
    answered = []
    pool.run_blocks(
        iter(ordered), method="prism", tolerance=0.0015, workers=1, limit=60.0, done=lambda n, _: answered.append(n)
    )
    assert answered[-2:] == [3, 2]


def test_a_child_that_hangs_is_ended(packed, monkeypatch):
    sleeper = [sys.executable, "-c", "import time; time.sleep(60)"]
    start = subprocess.Popen
    monkeypatch.setattr(pool.subprocess, "Popen", lambda command, **options: start(sleeper, **options))
    assert _run(packed[:2], limit=0.5) == {0: None, 1: None}


def test_what_fails_while_blocks_are_cut_is_passed_on_and_leaves_no_child(packed, monkeypatch):
    started = []
    start = subprocess.Popen
    monkeypatch.setattr(
        pool.subprocess, "Popen", lambda *words, **options: started.append(start(*words, **options)) or started[-1]
    )

    def cut():
        yield from packed[:2]
        raise ValueError("no solid")

    with pytest.raises(ValueError, match="no solid"):
        _run(cut())
    assert all(child.poll() is not None for child in started)


def test_many_children_with_little_to_do_all_end(packed, monkeypatch):
    stop = pool._Child.stop
    monkeypatch.setattr(pool._Child, "stop", lambda child: (time.sleep(0.05), stop(child)))  # others run meanwhile
    answers = {}
    run = threading.Thread(
        target=lambda: pool.run_blocks(
            packed[:1], method="prism", tolerance=0.0015, workers=12, limit=60.0, done=answers.__setitem__
        ),
        daemon=True,
    )
    run.start()
    run.join(30.0)
    assert not run.is_alive()
    assert list(answers) == [0]
