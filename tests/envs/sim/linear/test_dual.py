"""Derivatives that a program carries are those of the functions it computes, in every lane and direction."""

import ctypes

import numpy as np
import pytest
from llvmlite import ir

from haustra.envs.sim.linear.compile import engine_of, write_program
from haustra.envs.sim.linear.dual import DualLanes, DualProgram, with_slopes
from haustra.envs.sim.linear.trace import Value

RANDOM = np.random.default_rng(0)


def run(lanes, directions, write, given, slopes, outputs):
    """Outputs of a program (outputs, lanes), and their derivatives (outputs, directions, lanes)."""
    pointer = ir.PointerType()
    about = {"lanes": lanes, "real": np.dtype(float), "directions": directions}
    program = DualProgram("advance", [pointer, pointer], **about)
    source, target = program.function.args
    counts = program.index(len(given)), program.index(outputs)
    write(
        program,
        *(DualLanes.behind(program, base, lanes, slots=n) for base, n in zip((source, target), counts, strict=True)),
    )
    engine = engine_of(program.finish())
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(engine.get_function_address("advance"))
    own = with_slopes(np.asarray(given, float)[None], directions)
    own[0, len(given) :] = np.reshape(slopes, (-1, lanes))
    found = with_slopes(np.zeros((1, outputs, lanes)), directions)
    call(own.ctypes.data, found.ctypes.data)
    return found[0, :outputs], found[0, outputs:].reshape(outputs, directions, lanes)


@pytest.mark.parametrize(("lanes", "directions"), [(4, 3), (4, 4), (1, 1), (1, 5)])
def test_functions_have_their_derivatives(lanes, directions):
    """The chain rule, against derivatives written down by hand."""

    def write(program, source, target):
        xp, p, q = program.xp, source.load(0), source.load(1)
        sine, versine = xp.sine_versine(p * 5.0)
        target.put(0, [xp.arctan2(p, q), xp.sqrt(p * p + 1), xp.floor(p * 3), sine, versine, xp.exp(-xp.abs(p))])
        target.put(6, [xp.where(p > q, p, 2 * q), xp.clip(p, -0.5, 0.5), (p - 1) / (q * q + 1), p**3])
        target.put(10, [xp.minimum(p, q), -p, 3.0 / q - 2.0, xp.sqrt(0.0 * p), 1.0 * (xp.int32(p * 7) % 5)])

    p, q = RANDOM.normal(size=(2, lanes))
    dp, dq = RANDOM.normal(size=(2, directions, lanes))
    values, found = run(lanes, directions, write, [p, q], [dp, dq], 15)
    none, square = 0 * dp, q * q + 1
    known = [(q * dp - p * dq) / (p * p + q * q), p * dp / np.sqrt(p * p + 1), none, 5 * np.cos(5 * p) * dp]
    known += [5 * np.sin(5 * p) * dp, -np.sign(p) * np.exp(-abs(p)) * dp, np.where(p > q, dp, 2 * dq)]
    known += [np.where(abs(p) < 0.5, dp, 0.0), dp / square - (p - 1) * 2 * q * dq / square**2, 3 * p * p * dp]
    known += [np.where(p < q, dp, dq), -dp, -3 / q**2 * dq, none, none]
    np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(values[0], np.arctan2(p, q), rtol=1e-14)


def test_what_is_kept_keeps_its_derivatives():
    """In variables, through loops and conditions, and in slots that differ by lane."""

    def write(program, source, target):
        total = program.variable(1.0)
        with program.loop(0, 3) as i:
            total.value = total.value * source.load(i)
        target.store(0, total.value)
        with program.when(source.load(3) > 0):
            target.store(0, 2.0 * total.value)
        row: Value = program.xp.int32(source.load(3))
        target.store(1, source.gather(row))
        target.store(2, source.from_slot(1).load(1))
        target.store(3, 5.0)
        target.scatter(row + 3, source.load(0))

    given = [*RANDOM.normal(size=(3, 4)), np.array([0.0, 1.0, 2.0, 1.0])]
    slopes = [*RANDOM.normal(size=(3, 2, 4)), np.zeros((2, 4))]
    _, found = run(4, 2, write, given, slopes, 6)
    a, b, c = given[:3]
    product = 2 * (slopes[0] * b * c + a * slopes[1] * c + a * b * slopes[2])
    np.testing.assert_allclose(found[0], product, rtol=1e-12)
    np.testing.assert_array_equal(found[2], slopes[2])
    for lane, row in enumerate([0, 1, 2, 1]):
        np.testing.assert_array_equal(found[1, :, lane], slopes[row][:, lane])
        np.testing.assert_array_equal(found[3 + row, :, lane], slopes[0][:, lane])


def test_nobody_pays_who_does_not_ask():
    """Without directions, a program's text is what it is without this module: not one vector of derivatives in it."""
    about = {"lanes": 4, "real": np.float64, "timestep": 0.005, "angles": 16, "one_design": True, "moving": False}
    plain, dual = write_program(**about), write_program(**about, directions=8)
    assert "<32 x double>" not in plain
    assert "<32 x double>" in dual
