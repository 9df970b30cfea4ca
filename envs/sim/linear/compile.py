"""From a program to a function: machine code for this processor, kept from one run to the next."""

import ctypes
import functools
import hashlib
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from haustra.envs.sim.linear.layout import WORLD, Layout, design_slots, seen_slot
from haustra.envs.sim.linear.memory import Lanes, Rows, Shared
from haustra.envs.sim.linear.program import ARGUMENTS, COUNTS, ScopeProgram
from haustra.envs.sim.linear.trace import INDEX, Program, Value
from haustra.models.wall import cache

LONG = ir.IntType(64)
_BYTES = 32
"""Width of the registers that a program is written for, in bytes: eight numbers in single precision."""


def lanes_of(real: Any) -> int:
    """Worlds that one instruction serves on a CPU."""
    return _BYTES // np.dtype(real).itemsize


def write_program(*, lanes: int, real: Any, timestep: float, angles: int, one_design: bool) -> str:
    """A control step of blocks of worlds on a CPU, in LLVM's language.

    Args:
        lanes: worlds of a block.
        real: precision.
        timestep: [s].
        angles: of the wall's table.
        one_design: whether all worlds have the same design; else each has its own.
    """
    pointer = ir.PointerType()
    program = Program("advance", [pointer] * len(ARGUMENTS) + [INDEX] * len(COUNTS), lanes=lanes, real=np.dtype(real))
    arguments = program.function.args
    named = dict(zip(ARGUMENTS, arguments, strict=False))
    *counts, steps, first, last = (Value(program, each) for each in arguments[len(ARGUMENTS) :])
    with program.loop(first, last) as block:
        own = _block(program, named, block, tuple(counts), angles=angles, one_design=one_design)
        scopes = ScopeProgram(program, own, tuple(counts), timestep=timestep)
        with program.when(steps > 0):
            scopes.advance(steps)
        scopes.observe()
    return program.finish()


def _block(
    program: Program, arrays: dict[str, Any], block: Value, counts: Any, *, angles: int, one_design: bool
) -> dict[str, Any]:
    """Arrays of one block's worlds."""
    *parts, coils = counts
    layout, builder = Layout(*parts), program.builder
    size = {
        "state": layout.state,
        "worlds": program.index(len(WORLD)),
        "seen": coils * 3 + seen_slot("coils") + layout.bodies,
        "design": design_slots(*parts)[-1],
    }

    def lanes(name: str) -> Lanes:
        wide = [builder.sext(each.written, LONG) for each in (size[name] * program.lanes, block)]
        start = builder.gep(arrays[name], [builder.mul(*wide)], source_etype=program.real)
        return Lanes(program, start, program.lanes)

    return {
        "state": lanes("state"),
        "worlds": lanes("worlds"),
        "seen": lanes("seen"),
        "room": Lanes(program, arrays["room"], program.lanes),
        "design": Shared(program, arrays["design"]) if one_design else lanes("design"),
        "structure": Shared(program, arrays["structure"], whole=True),
        "stations": Rows(program, arrays["stations"], 4),
        "wall": (Rows(program, arrays["wall"], 1), angles),
    }


@functools.cache
def _machine() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=True)


@functools.cache
def compiled(text: str) -> tuple[Any, Callable[..., None]]:
    """The function of a program (`write_program`), and what keeps it alive."""
    machine = _machine()
    about = (text, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten(), str(llvm.llvm_version_info))
    path = cache.cache_folder() / "linear" / f"{hashlib.sha256(chr(10).join(about).encode()).hexdigest()[:32]}.o"
    kept = cache.read(path)
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    if kept is None:
        module.verify()
        options = llvm.create_pipeline_tuning_options(speed_level=3)
        builder = llvm.create_pass_builder(machine, options)
        builder.getModulePassManager().run(module, builder)
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.set_object_cache(lambda _, code: cache.keep(path, code), lambda _: kept)
    engine.finalize_object()
    kinds = [ctypes.c_void_p] * len(ARGUMENTS) + [ctypes.c_int32] * len(COUNTS)
    return engine, ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address("advance"))
