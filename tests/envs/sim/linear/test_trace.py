"""What a program computes is what numpy computes, in every lane and precision."""

import ctypes

import numpy as np
import pytest
from llvmlite import ir

from haustra.envs.sim.linear.compile import engine_of
from haustra.envs.sim.linear.memory import Lanes, Rows
from haustra.envs.sim.linear.place import aligned
from haustra.envs.sim.linear.trace import INDEX, Program, Value

RANDOM = np.random.default_rng(0)


def run(real, lanes, write, given, outputs=1):
    """A program that writes `outputs` numbers from `given` (numbers, lanes)."""
    pointer = ir.PointerType()
    program = Program("advance", [pointer, pointer, INDEX], lanes=lanes, real=np.dtype(real))
    source, target, count = program.function.args
    write(program, Lanes(program, source, lanes), Lanes(program, target, lanes), Value(program, count))
    engine = engine_of(program.finish())
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int32)(
        engine.get_function_address("advance")
    )
    own, found = np.ascontiguousarray(given, real), aligned(np.zeros((outputs, lanes)), real)
    call(own.ctypes.data, found.ctypes.data, len(given))
    return found


@pytest.mark.parametrize(
    ("real", "lanes", "within"), [(np.float32, 8, 3e-7), (np.float64, 4, 1e-15), (np.float32, 1, 3e-7)]
)
def test_functions_are_numpys(real, lanes, within):
    x, y = RANDOM.normal(size=(2, 40, lanes))
    for a, b in zip(x, y, strict=True):

        def write(program, source, target, _):
            xp = program.xp
            p, q = source.load(0), source.load(1)
            sine, versine = xp.sine_versine(p * 5.0)
            target.put(0, [xp.arctan2(p, q), xp.sqrt(p * p), xp.floor(p * 3), sine, versine, xp.exp(-xp.abs(p))])
            target.put(6, [xp.where(p > q, p, 2 * q), xp.clip(p, -0.5, 0.5), (p - 1) / (q * q + 1), p**3])
            target.put(10, [xp.minimum(p, q), xp.maximum(p, 0.0), 1.0 * (xp.int32(p * 7) % 5), -p])
            target.put(14, [xp.sin(p * 5.0), xp.cos(p * 5.0), xp.where(~(p > q), p, xp.nan)])

        found = run(real, lanes, write, np.stack([a, b]), 17)
        p, q = a.astype(real), b.astype(real)
        known = [np.arctan2(p, q), abs(p), np.floor(p * 3), np.sin(p * 5), 1 - np.cos(p * 5), np.exp(-abs(p))]
        known += [np.where(p > q, p, 2 * q), np.clip(p, -0.5, 0.5), (p - 1) / (q * q + 1), p**3]
        known += [np.minimum(p, q), np.maximum(p, 0), np.trunc(p * 7).astype(int) % 5, -p]
        known += [np.sin(p * 5), np.cos(p * 5), np.where(p > q, np.nan, p)]
        np.testing.assert_allclose(found, known, rtol=20 * within, atol=8 * within)


def test_the_angle_of_nothing_is_nothing():
    """As numpy says of a sphere that stands on the colon's very axis."""

    def write(program, source, target, count):
        target.put(0, [program.xp.arctan2(source.load(0), source.load(1))])

    assert (run(np.float64, 1, write, np.zeros((2, 1)), 1) == 0).all()


def test_loops_run_forth_and_back_and_conditions_hold_in_any_lane():
    def write(program, source, target, count):
        total, late = program.variable(0.0), program.variable(0.0)
        with program.loop(0, count) as i:
            total.value = total.value * 2 + source.load(i)
        with program.loop(0, count, backwards=True) as i:
            late.value = late.value * 2 + source.load(i)
        target.put(0, [total.value, late.value])
        with program.when(source.load(0) > 0):
            target.store(2, program.xp.where(source.load(0) > 0, 5.0, target.load(2)))

    given = np.array([[1.0, -1.0, 2.0, 0.0], [3.0, 1.0, 0.0, 1.0], [1.0, 1.0, 1.0, 4.0]])
    found = run(np.float64, 4, write, given, 3)
    np.testing.assert_array_equal(found[0], given[0] * 4 + given[1] * 2 + given[2])
    np.testing.assert_array_equal(found[1], given[2] * 4 + given[1] * 2 + given[0])
    np.testing.assert_array_equal(found[2], [5, 0, 5, 0])


def test_what_is_no_number_stays_so_and_reads_the_first_row():
    def write(program, source, target, _):
        place = program.xp.int32(source.load(0))
        target.put(0, [1.0 * place, source.load(0) + 1.0])

    found = run(np.float32, 8, write, np.array([[np.nan, np.inf, -np.inf, 3.7, -2.5, 0.0, 1e20, 7.0]]), 2)
    assert found[0].tolist()[0] == 0
    assert found[0, 3:6].tolist() == [3, -2, 0]
    assert np.isnan(found[1, 0])


@pytest.mark.parametrize(("real", "lanes"), [(np.float32, 8), (np.float64, 4), (np.float32, 16), (np.float32, 1)])
def test_rows_are_read_by_fours(real, lanes):
    table = RANDOM.normal(size=(10, 8)).astype(real)
    raw = np.zeros(table.nbytes + 64, np.uint8)
    start = -raw.ctypes.data % 64
    held = raw[start : start + table.nbytes].view(real).reshape(table.shape)
    held[...] = table
    rows = RANDOM.integers(0, 10, (1, lanes))

    def write(program, source, target, _):
        address = program.builder.inttoptr(ir.Constant(ir.IntType(64), held.ctypes.data), ir.PointerType())
        where = Rows(program, address, 2)
        row = program.xp.int32(source.load(0))
        target.put(0, [where.read(row, column) for column in range(8)])

    found = run(real, lanes, write, rows.astype(float), 8)
    np.testing.assert_array_equal(found, table[rows[0]].T)


@pytest.mark.parametrize(("real", "abreast"), [(np.float32, 8), (np.float64, 4), (np.float32, 16)])
def test_what_stands_side_by_side_is_put_row_by_row(real, abreast):
    given = RANDOM.normal(size=(8, abreast)).astype(real)

    def write(program, source, target, _):
        with program.side_by_side(abreast):
            kinds = [source.load_next(kind * abreast) for kind in range(8)]
            for column in (0, 4):
                target.rows(0, 2).put(program.index(0), column, kinds[column : column + 4])

    found = run(real, 1, write, given.reshape(-1, 1), 8 * abreast)
    np.testing.assert_array_equal(found.reshape(abreast, 8), given.T)


def test_a_law_that_branches_cannot_be_written_down():
    program = Program("advance", [], lanes=1, real=np.dtype(np.float32))
    with pytest.raises(TypeError, match=r"xp\.where"):
        bool(program.constant(1.0) > 0)
