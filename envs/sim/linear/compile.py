"""From a program to a function: machine code for this processor, kept from one run to the next."""

import ctypes
import functools
import gc
import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from haustra.envs.sim.linear.alone import AloneProgram
from haustra.envs.sim.linear.dual import DualLanes, DualProgram
from haustra.envs.sim.linear.layout import WORLD, Layout, seen_slot
from haustra.envs.sim.linear.memory import Lanes, Rows, Shared
from haustra.envs.sim.linear.program import ARGUMENTS, COUNTS, WRITTEN, ScopeProgram
from haustra.envs.sim.linear.team import TeamProgram
from haustra.envs.sim.linear.trace import INDEX, Program, Value
from haustra.models.wall import cache

LONG = ir.IntType(64)
_PASSES = 3
"""How much LLVM is to better a CPU's program before it makes machine code of it, from nothing, 0, to all it can, 3."""
_BYTES = 32
"""Width of the registers that a program is written for, in bytes: eight numbers in single precision."""


@runtime_checkable
class Driver(Protocol):
    """Who drives scopes within a program, instead of hands outside it; those that are equal write the same."""

    @property
    def slots(self) -> int:
        """Numbers that it keeps of each world."""
        ...

    @property
    def asks(self) -> int:
        """Numbers of each world that it is given from outside at every launch (`ScopeProgram.asked`)."""
        ...

    @property
    def tells(self) -> int:
        """Numbers of each world that it hands out (`ScopeProgram.told`)."""
        ...

    @property
    def room(self) -> int:
        """Slots that it needs of each world's room to work in."""
        ...

    def write(self, scopes: ScopeProgram, numbers: Lanes, room: Lanes, count: Value) -> None:
        """Write down `count` of its decisions, and what each leads to."""
        ...


def lanes_of(real: Any) -> int:
    """Worlds that one instruction serves on a CPU."""
    return _BYTES // np.dtype(real).itemsize


@contextmanager
def _uncollected() -> Iterator[None]:
    """Let garbage lie meanwhile.

    All of the half a million objects of a program live until it is written: the collector would walk through them and
    everything else again and again, for half of the time that writing takes.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@functools.cache
@_uncollected()
def write_program(
    *,
    lanes: int,
    real: Any,
    timestep: float,
    angles: int,
    one_design: bool,
    moving: bool,
    surrounded: bool = False,
    rooted: bool = False,
    touching: bool = False,
    wheels: bool = False,
    gas: bool = False,
    driver: Driver | None = None,
    directions: int = 0,
    abreast: int = 1,
    **wall: Any,
) -> str:
    """A control step of blocks of worlds on a CPU, in LLVM's language.

    Args:
        lanes: worlds of a block.
        real: precision.
        timestep: [s].
        angles: of the wall's table.
        one_design: whether all worlds have the same design; else each has its own.
        moving: whether colons move on their mesentery.
        surrounded: whether those have an envelope or breath around them.
        rooted: whether their mesenteries hang from their roots.
        touching: whether their loops touch.
        wheels: whether hands ask for travel of wires, which are springs then, instead of pulls.
        gas: whether gas sets how wide lumens are.
        driver: who decides what the hands ask for; None: that is given. `steps` of `COUNTS` are then decisions.
        directions: along how many the derivatives of all numbers are carried.
        abreast: things of one world, such as nodes or spheres, that one instruction serves where that world is alone.
        wall: what else `ScopeProgram` is told of the wall.
    """
    program, arrays, counts, (steps, row, first, last) = _begun(lanes, real, directions=directions)
    around = {"moving": moving, "surrounded": surrounded, "rooted": rooted, "touching": touching}
    around["by_turns"] = lanes == 1 and abreast == 1 and not directions
    with program.loop(first, last) as block:
        layout = Layout(*counts[:-1], wheels=wheels, abreast=abreast, **around)
        own = _Worlds(program, arrays, (layout, counts[-1]), driver, block=block, stride=lanes, row=row)
        given = own.arrays(angles, one_design, moving, gas=gas)
        kind = ScopeProgram if abreast == 1 else AloneProgram
        scopes = kind(program, given, layout, counts[-1], timestep=timestep, **wall)
        _step(program, scopes, given, steps, driver)
    return program.finish()


WARP = 32
"""Threads that a graphics processor runs together; each steps a world."""
_REGISTERS = 184
"""Registers of a thread at most where a GPU is full and colons move: as fast as any that was tried of 152 to 255, with
a design a world or one (docs/decisions/linear.md); engineering choice."""


@functools.cache
@_uncollected()
def write_kernel(
    *,
    group: int = WARP,
    real: Any,
    timestep: float,
    angles: int,
    one_design: bool,
    moving: bool,
    surrounded: bool = False,
    rooted: bool = False,
    touching: bool = False,
    wheels: bool = False,
    driver: Driver | None = None,
    abreast: int = 1,
    **wall: Any,
) -> str:
    """A control step of worlds on a graphics processor; `last` of `COUNTS` is how many worlds there are.

    `group` worlds are a block: their numbers lie side by side, and their threads are placed together. Or a block is one
    world, whose things stand in `abreast` threads (`team.TeamProgram`).
    """
    teams = abreast > 1
    program, arrays, counts, (steps, row, _, worlds) = _begun(1, real, approximate=True, team=abreast)
    around = {"moving": moving, "surrounded": surrounded, "rooted": rooted, "touching": touching}
    around["by_turns"] = program.fetches = not teams
    if moving and group == WARP:
        program.limit_registers(_REGISTERS)
    block, blocks = _launched_as(program, "ctaid", "nctaid")
    lane = program.index(0) if teams else _launched_as(program, "tid")[0]
    # Blocks that are launched take worlds in turn, so that there are rooms for those only that run at the same time.
    rounds = (worlds + group * blocks - 1 - group * block) // (group * blocks)
    with program.loop(0, rounds) as turn:
        first = block + turn * blocks
        with program.when(first * group + lane < worlds):
            layout = Layout(*counts[:-1], wheels=wheels, abreast=abreast, **around)
            place: dict[str, Any] = {"block": first, "stride": group, "lane": lane, "row": row}
            own = _Worlds(program, arrays, (layout, counts[-1]), driver, **place)
            given = own.arrays(angles, one_design, moving, room_of_block=block)
            kind = AloneProgram if teams else ScopeProgram
            scopes = kind(program, given, layout, counts[-1], timestep=timestep, **wall)
            _step(program, scopes, given, steps, driver)
    return program.finish()


def thread_of(program: Program) -> Value:
    """Number of a thread on a graphics processor, of whose kernels the program is one."""
    block, size, thread = _launched_as(program, "ctaid", "ntid", "tid")
    return block * size + thread


def _launched_as(program: Program, *registers: str) -> list[Value]:
    """What registers of a graphics processor say of a thread of a kernel, which the program is."""
    program.function.calling_convention = "ptx_kernel"
    kind, name = ir.FunctionType(INDEX, []), "llvm.nvvm.read.ptx.sreg.{}.x"
    asked = [ir.Function(program.module, kind, name.format(each)) for each in registers]
    return [Value(program, program.builder.call(each, [])) for each in asked]


def _begun(
    lanes: int, real: Any, *, approximate: bool = False, directions: int = 0, team: int = 1
) -> tuple[Program, dict[str, Any], Any, list[Value]]:
    """A program without anything in it, its arrays, what it counts, and its last arguments."""
    kinds = [ir.PointerType()] * len(ARGUMENTS) + [INDEX] * len(COUNTS)
    about: dict[str, Any] = {"real": np.dtype(real), "approximate": approximate}
    if team > 1:
        written = [ARGUMENTS.index(each) for each in WRITTEN]
        program: Program = TeamProgram("advance", kinds, team=team, written=written, **about)
    else:
        kind = functools.partial(DualProgram, directions=directions) if directions else Program
        program = kind("advance", kinds, lanes=lanes, **about)
    arguments = program.function.args
    *counts, steps, row, first, last = (Value(program, each) for each in arguments[len(ARGUMENTS) :])
    return program, dict(zip(ARGUMENTS, arguments, strict=False)), tuple(counts), [steps, row, first, last]


def _step(program: Program, scopes: ScopeProgram, arrays: dict[str, Any], steps: Value, driver: Driver | None) -> None:
    scopes.lay()
    if driver:
        with program.when(steps > 0):
            driver.write(scopes, arrays["driver"], scopes.room.from_slot(scopes.layout.room), steps)
        with program.when(steps == 0):
            scopes.observe()
        return
    with program.when(steps > 0):
        scopes.advance(steps)
    scopes.observe()


class _Worlds:
    """Arrays of the worlds that are stepped together."""

    def __init__(
        self,
        program: Program,
        arrays: dict[str, Any],
        counts: tuple[Layout, Value],
        driver: Driver | None,
        *,
        block: Value,
        stride: int,
        row: Value,
        lane: Any = None,
    ) -> None:
        self._program, self._arrays, self._block, self._stride, self._lane = program, arrays, block, stride, lane
        self._row = row
        layout, coils = counts
        self._columns = len(layout.columns)
        self._sizes = {
            "state": layout.state,
            "worlds": program.index(len(WORLD)),
            "seen": coils * 3 + seen_slot("coils") + layout.bodies,
            "room": layout.padded(layout.room + (driver.room if driver else 0)),
            "driver": program.index(driver.slots if driver else 1),
            "design": layout.design[-1],
        }

    def arrays(
        self, angles: int, one_design: bool, moving: bool, *, room_of_block: Value | None = None, gas: bool = False
    ) -> dict[str, Any]:
        """By the names of `ARGUMENTS`; of the rooms there are, that of a block that runs, if it is told, or the one."""
        program, given = self._program, self._arrays
        own: dict[str, Any] = {name: self._lanes(name) for name in ("state", "worlds", "seen", "driver")}
        own["room"] = (
            self._lanes("room", room_of_block) if room_of_block is not None else self._from(given["room"], "room")
        )
        own["design"] = Shared(program, given["design"]) if one_design else self._lanes("design")
        own["structure"] = Shared(program, given["structure"], whole=True)
        own |= {name: self._of_rows(name) for name in ("asked", "told", "widths")}
        own["widths"] = own["widths"] if gas else None
        own["lookup"], own["first_world"] = Shared(program, given["lookup"]), self._first
        tables = {"stations": Rows(program, given["stations"], 4), "wall": (Rows(program, given["wall"], 1), angles)}
        return own | tables | {"axis": Rows(program, given["axis"], self._columns // 4) if moving else None}

    def _lanes(self, name: str, block: Value | None = None) -> Lanes:
        """Numbers of a block, or of the worlds' own."""
        program, builder = self._program, self._program.builder
        slots = self._sizes[name]
        if isinstance(program, DualProgram):
            slots = slots * (1 + program.directions)
        size = builder.sext((slots * self._stride).written, LONG)
        start = builder.mul(size, builder.sext((self._block if block is None else block).written, LONG))
        if self._lane is not None:
            start = builder.add(start, builder.sext(self._lane.written, LONG))
        return self._from(builder.gep(self._arrays[name], [start], source_etype=program.real), name)

    def _of_rows(self, name: str) -> Lanes:
        """Numbers that lie in one row for all worlds."""
        program = self._program
        base = program.builder.gep(self._arrays[name], [self._first.written], source_etype=program.real)
        return Lanes(program, base, self._row)

    @property
    def _first(self) -> Value:
        """Number of the first of these worlds."""
        return self._block * self._stride + (0 if self._lane is None else self._lane)

    def _from(self, base: Any, name: str) -> Lanes:
        program = self._program
        if isinstance(program, DualProgram):
            return DualLanes.behind(program, base, self._stride, slots=self._sizes[name])
        return Lanes(program, base, self._stride)


def _machine() -> Any:
    """This processor; an engine owns the one that it was made with."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=True)


@functools.cache
def compiled(text: str) -> tuple[Any, Callable[..., None]]:
    """The function of a program (`write_program`), and what keeps it alive."""
    engine = engine_of(text)
    kinds = [ctypes.c_void_p] * len(ARGUMENTS) + [ctypes.c_int32] * len(COUNTS)
    return engine, ctypes.CFUNCTYPE(None, *kinds)(engine.get_function_address("advance"))


def engine_of(text: str) -> Any:
    """LLVM's engine with the machine code of a program, new or kept from before."""
    machine = _machine()
    path = _kept_at(f"{text}{llvm.get_host_cpu_name()}{llvm.get_host_cpu_features().flatten()}{_PASSES}", "o")
    code = cache.read(path)
    if code is None:
        code = machine.emit_object(_module(text, machine, passes=_PASSES))
        cache.keep(path, code)
    # Without LLVM's own cache of objects, which calls Python back: an interruption there would be lost.
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def assembled(text: str, *, architecture: str = "sm_80") -> str:
    """A kernel (`write_kernel`) in the language of NVIDIA's drivers, which finish it for the processor they drive."""
    path = _kept_at(f"{text}{architecture}", "ptx")
    if kept := cache.read(path):
        return kept.decode()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple("nvptx64-nvidia-cuda")
    machine = target.create_target_machine(cpu=architecture, opt=3)
    found = machine.emit_assembly(_module(text, machine, passes=3))
    cache.keep(path, found.encode())
    return found


def _kept_at(about: str, kind: str) -> Path:
    """Where what was compiled is kept."""
    key = hashlib.sha256(f"{about}{llvm.llvm_version_info}".encode()).hexdigest()[:32]
    return cache.cache_folder() / "linear" / f"{key}.{kind}"


def _module(text: str, machine: Any, *, passes: int) -> Any:
    """LLVM's module of a program for a processor, bettered by some of its passes (`_PASSES`)."""
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    module.verify()
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=passes))
    builder.getModulePassManager().run(module, builder)
    return module
