"""Programs as tests compile them, without LLVM's passes, and as users do, with all of them: they differ by rounding."""

import numpy as np
import pytest

from haustra.envs.sim.linear import compile as programs
from haustra.envs.sim.linear.place import forget
from haustra.scripts.bench.linear import bank_of, driven


@pytest.mark.parametrize("mesentery", [False, True])
def test_what_passes_change_is_rounding(mesentery: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    bank, ends = bank_of(40, colons=1, mesentery=mesentery), []
    for passes in (0, 3):
        monkeypatch.setattr(programs, "_PASSES", passes)
        forget()
        ends.append(driven(bank, 4, seconds=1.0, real=np.float64)[0].state())
    forget()
    plain, bettered = ends
    assert np.abs(bettered.qpos).max() > 0.01
    np.testing.assert_allclose(plain.qpos, bettered.qpos, rtol=0, atol=1e-9)
    np.testing.assert_allclose(plain.normal, bettered.normal, rtol=0, atol=1e-5)


def test_code_is_kept_apart_by_its_passes(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """What a test compiled is not what a user gets."""
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path))
    text = programs.write_program(
        lanes=1, real=np.float64, timestep=0.005, angles=8, one_design=True, moving=False, abreast=1
    )
    for passes in (0, 3):
        monkeypatch.setattr(programs, "_PASSES", passes)
        programs.engine_of(text)
    assert len({path.read_bytes() for path in tmp_path.rglob("*.o")}) == 2
