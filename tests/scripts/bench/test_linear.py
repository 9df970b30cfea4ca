"""What `haustra bench linear` reports: designs of each world, launches that repeat, times of compiling."""

import json
from functools import cache, partial

import numpy as np
import pytest

from haustra.envs.sim.linear import compile
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.place import WARP, group_of
from haustra.envs.sim.scope_colon_set import build_bank
from haustra.errors import MissingDependencyError
from haustra.models.devices.scope.library import named_design
from haustra.scripts.bench import linear
from haustra.scripts.bench.linear import bank_of, compile_cost, driven, repeated
from haustra.scripts.main import SUCCESS, main
from tests.tube_colon import straight_tube


@cache
def _bank(mesentery=False):
    return bank_of(40, colons=1, mesentery=mesentery)


@pytest.mark.parametrize("mesentery", [False, True])
def test_a_launch_repeats_to_the_bit_with_a_design_in_each_world(mesentery):
    backend, hands = driven(_bank(mesentery), 9, seconds=1.0, designs=True)
    assert repeated(backend, hands, steps=20) == 0
    designs = np.swapaxes(backend.numbers("design"), 1, 2).reshape(-1, backend.numbers("design").shape[1])[:9]
    assert len(np.unique(designs, axis=0)) == 8 and (designs[0] == designs[8]).all()


@pytest.mark.parametrize("mesentery", [False, True])
@pytest.mark.parametrize("worlds", [40, 1_100])
def test_a_launch_on_a_gpu_repeats_to_the_bit(mesentery, worlds):
    bank = _bank(mesentery)
    try:
        LinearBackend(bank.scene, bank.tables, worlds=1, device="cuda").close()
    except MissingDependencyError as error:
        pytest.skip(f"there is no NVIDIA GPU here: {error}")
    backend, hands = driven(bank, worlds, seconds=1.0, designs=True, device="cuda")
    assert repeated(backend, hands, steps=20) == 0


def test_a_program_is_compiled_once_and_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both backends whose time is taken ask for the same programs, of which only the first has to be compiled."""
    made, asked, plain, engine_of = [], [], compile._module, compile.engine_of
    monkeypatch.setattr(
        compile, "_module", lambda text, *how, **passes: (made.append(text), plain(text, *how, **passes))[1]
    )
    monkeypatch.setattr(compile, "engine_of", lambda text: (asked.append(text), engine_of(text))[1])
    times = compile_cost(_bank())
    assert made and len(made) == len(set(made)) and sorted(asked) == sorted(2 * made)
    assert all(seconds > 0 for seconds in times)


def test_worlds_are_grouped_by_how_many_there_are():
    groups = [group_of(worlds) for worlds in (1, 512, 1_024, 2_048, 8_192, 32_768, 131_072)]
    assert groups == [1, 2, 4, 8, 8, WARP, WARP]


def test_its_json_holds_rows_exponent_and_difference(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a short tube, with few worlds to compare with the dense step."""
    bank = build_bank([straight_tube()], named_design("adult"))
    monkeypatch.setattr(linear, "bank_of", lambda dofs, mesentery: bank)
    monkeypatch.setattr(linear, "largest_difference", partial(linear.largest_difference, worlds=2, instants=1))
    assert main(["bench", "linear", "--json", "--worlds", "1", "--dofs", "40,80"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found.keys() >= {"rows", "exponent", "largest_difference"}
    assert all(row.keys() >= {"dofs", "worlds", "us_per_step", "us_per_step_dense"} for row in found["rows"])
    assert len(found["rows"]) == 2 and all(row["us_per_step"] > 0 for row in found["rows"])
    assert 0 <= found["largest_difference"] < 1e-9
