"""Teams of threads step a world as one thread does. What a GPU passes from one to another goes through memory here."""

import ctypes
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.linear.compile import assembled, engine_of, write_kernel
from haustra.envs.sim.linear.place import CpuPlace, team_of
from haustra.envs.sim.linear.program import ARGUMENTS, COUNTS
from haustra.envs.sim.scope_colon_set import build_bank
from haustra.models.wall.abdomen import Abdomen
from haustra.scripts.bench.linear import bank_of, driven

TEAM = 4
FEW = {"timestep": 0.004, "angles": 8, "one_design": True}
PASSED = """
@here = global i32 0
@arrived = global i32 0
@round = global i32 0
@places = global [32 x i64] zeroinitializer
declare i32 @sched_yield()

define i32 @ticket() {{
  %own = atomicrmw add ptr @here, i32 1 seq_cst
  ret i32 %own
}}

define void @settle() {{
  %now = load atomic i32, ptr @round seq_cst, align 4
  %own = atomicrmw add ptr @arrived, i32 1 seq_cst
  %count = add i32 %own, 1
  %rest = urem i32 %count, {team}
  %last = icmp eq i32 %rest, 0
  br i1 %last, label %release, label %wait
release:
  atomicrmw add ptr @round, i32 1 seq_cst
  ret void
wait:
  %seen = load atomic i32, ptr @round seq_cst, align 4
  %on = icmp ne i32 %seen, %now
  br i1 %on, label %done, label %again
again:
  call i32 @sched_yield()
  br label %wait
done:
  ret void
}}

define i32 @pass_i32(i32 %own, i32 %value, i32 %from) {{
  %mine = getelementptr i64, ptr @places, i32 %own
  store i32 %value, ptr %mine
  call void @settle()
  %other = getelementptr i64, ptr @places, i32 %from
  %found = load i32, ptr %other
  call void @settle()
  ret i32 %found
}}

define float @pass_f32(i32 %own, float %value, i32 %from) {{
  %given = bitcast float %value to i32
  %taken = call i32 @pass_i32(i32 %own, i32 %given, i32 %from)
  %found = bitcast i32 %taken to float
  ret float %found
}}

define i1 @vote(i32 %own, i1 %held) {{
  %given = zext i1 %held to i32
{votes}
  %any = icmp ne i32 %sum{last}, 0
  ret i1 %any
}}
"""
"""What stands in for a warp's threads: a barrier, and numbers that are left where others find them."""


def on_threads(kernel: str) -> str:
    """A kernel as each of a team of the CPU's threads runs it."""
    votes = ["  %sum0 = call i32 @pass_i32(i32 %own, i32 %given, i32 0)"]
    for thread in range(1, TEAM):
        votes.append(f"  %held{thread} = call i32 @pass_i32(i32 %own, i32 %given, i32 {thread})")
        votes.append(f"  %sum{thread} = or i32 %sum{thread - 1}, %held{thread}")
    text = re.sub(r'declare .*@"llvm\.nvvm.*\n', "", kernel.replace("ptx_kernel ", ""))
    own = re.findall(r'(%"\.\d+") = call i32 @"llvm\.nvvm\.read\.ptx\.sreg\.tid\.x"\(\)', text)
    assert len(own) == 1, "a thread asks once which it is"
    for register, value in (("ctaid", "add i32 0, 0"), ("nctaid", "add i32 0, 1"), ("tid", "call i32 @ticket()")):
        text = text.replace(f'call i32 @"llvm.nvvm.read.ptx.sreg.{register}.x"()', value)
    text = re.sub(r'call void @"llvm\.nvvm\.bar\.warp\.sync"\(i32 \d+\)', "call void @settle()", text)
    text = re.sub(r'@"llvm\.nvvm\.vote\.any\.sync"\(i32 \d+, ', rf"@vote(i32 {own[0]}, ", text)
    text = re.sub(
        r'@"llvm\.nvvm\.shfl\.sync\.idx\.(.32)"\(i32 \d+, (.*?), i32 31\)', rf"@pass_\1(i32 {own[0]}, \2)", text
    )
    assert "nvvm" not in text
    return text + PASSED.format(team=TEAM, votes="\n".join(votes), last=TEAM - 1)


class TeamPlace(CpuPlace):
    """A team of threads steps each world."""

    def __init__(self, *, worlds: int, threads: int, real: Any, room: int, **program: Any) -> None:
        super().__init__(worlds=worlds, threads=threads, real=real, room=room, **program)
        self._engine = engine_of(on_threads(write_kernel.__wrapped__(group=1, real=real, **program)))
        kinds = [ctypes.c_void_p] * len(ARGUMENTS) + [ctypes.c_int32] * len(COUNTS)
        self._function = ctypes.CFUNCTYPE(None, *kinds)(self._engine.get_function_address("advance"))

    def run(self, arrays: dict[str, Any], counts: Any, worlds: int) -> None:
        own = arrays | {"room": self._rooms[0]}
        given = [*(own[name].pointer for name in ARGUMENTS), *counts, 0, worlds]
        for name in ("here", "arrived", "round"):
            ctypes.c_int32.from_address(self._engine.get_global_value_address(name)).value = 0
        with ThreadPoolExecutor(TEAM) as pool:
            for done in [pool.submit(self._function, *given) for _ in range(TEAM)]:
                done.result()


AROUND = Abdomen(envelope=True, breathing=True, rooted=True, loops_touch=True)


@pytest.mark.parametrize(("moves", "around"), [(False, Abdomen()), (True, Abdomen()), (True, AROUND)])
def test_a_team_steps_a_world_as_one_thread_does(moves, around, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("haustra.envs.sim.linear.backend.lanes_of", lambda real: TEAM)
    plain = bank_of(40, colons=1, mesentery=moves)
    options = replace(plain.scene.options, abdomen=around)
    bank = build_bank(plain.colons, plain.scene.design, options)
    plain, hands = driven(bank, 1, seconds=8.0)
    assert (plain.state().normal > 0).sum() > 2
    begun = plain.keep()
    monkeypatch.setattr("haustra.envs.sim.linear.backend.CpuPlace", TeamPlace)
    team, _ = driven(bank, 1, seconds=0.0)
    team.put_back(begun)
    inputs = hands.next()
    assert plain.step(inputs, 5).all()
    assert team.step(inputs, 5).all()
    one, other, before = plain.state(), team.state(), begun[0]["state"]
    assert np.abs(one.qpos[0] - before[0, : one.qpos.shape[1], 0]).max() > 1e-4
    np.testing.assert_allclose(other.qpos, one.qpos, rtol=0, atol=2e-6)
    np.testing.assert_allclose(other.arcs, one.arcs, rtol=0, atol=2e-6)
    np.testing.assert_allclose(other.normal, one.normal, rtol=0, atol=0.01)
    if one.displacement is not None and other.displacement is not None:
        np.testing.assert_allclose(other.displacement.pose, one.displacement.pose, rtol=0, atol=2e-6)
    np.testing.assert_allclose(team.read().tip, plain.read().tip, rtol=0, atol=2e-6)


def test_few_worlds_have_teams_and_double_precision_has_none() -> None:
    assert [team_of(worlds, np.float32) for worlds in (1, 400, 2_048, 2_049, 131_072)] == [16, 16, 16, 1, 1]
    assert team_of(400, np.float64) == 1


def test_a_kernel_of_teams_is_assembled() -> None:
    text = assembled(write_kernel.__wrapped__(group=1, abreast=16, real=np.float32, moving=True, **FEW))
    assert all(each in text for each in ("shfl.sync.idx", "vote.sync.any", "bar.warp.sync"))
    assert "bar.warp.sync" not in assembled(write_kernel.__wrapped__(real=np.float32, moving=True, **FEW))
