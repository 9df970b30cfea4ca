"""Every example runs as printed, in a short colon and for a short while, and its page is current."""

import runpy
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import pytest

import haustra
from haustra.envs.tasks import scope_task
from haustra.scripts.bench.pages.examples_page import examples_pages, picture_of
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.task_bank import short_bank

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"
PROGRAMS = sorted(EXAMPLES.glob("*.py"))
COSTLY = {"colon_from_ct", "data_set", "mujoco_viewer", "policy", "replay", "sb3", "tracked_robot"}
"""Programs that take colons as they are grown; the others go into a short bend here."""
SHORTEST = 0.2
LARGEST_PICTURE = 60_000
"""Pictures are small, so that the gallery loads at once [bytes]."""


def shortened(call: Any) -> Any:
    return lambda *given, seconds=60.0, **options: call(*given, seconds=min(seconds, SHORTEST), **options)


@pytest.fixture
def miniature(program: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Runs last a fifth of a second, and pictures go nowhere but into files."""
    if program.stem not in COSTLY:
        bend = swept_colon(winding([(0.08, 0.0), (0.08, 0.6), (0.12, 0.0)]), name="bend 0.6")
        monkeypatch.setattr(haustra, "grow_colon", lambda **_: bend)
    for name in ("simulate", "run_device"):
        monkeypatch.setattr(haustra, name, shortened(getattr(haustra, name)))
    paediatric = short_bank()
    monkeypatch.setattr(
        scope_task, "grown_bank", lambda seeds, design, **_: replace(paediatric, cases=paediatric.cases[:1])
    )
    monkeypatch.delenv("DISPLAY", raising=False)
    before = matplotlib.get_backend()
    plt.switch_backend("agg")
    yield
    plt.close("all")
    plt.switch_backend(before)


@pytest.mark.parametrize(
    "program",
    [pytest.param(each, marks=[pytest.mark.thorough] if each.stem in COSTLY else []) for each in PROGRAMS],
    ids=lambda each: each.stem,
)
def test_it_runs_and_leaves_its_picture(
    program: Path, miniature: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(program), run_name="__main__")
    assert capsys.readouterr().out.strip()
    assert (tmp_path / picture_of(program)).stat().st_size > 500


def test_there_are_a_dozen_each_short_with_a_small_picture_and_a_current_page() -> None:
    assert len(PROGRAMS) >= 12
    for program in PROGRAMS:
        assert len(program.read_text(encoding="utf-8").splitlines()) <= 50, program.name
        assert (EXAMPLES / picture_of(program)).stat().st_size <= LARGEST_PICTURE, program.name
    for name, text in examples_pages(EXAMPLES).items():
        assert (EXAMPLES / name).read_text(encoding="utf-8") == text, (
            f"{name} is older than its program: python -m haustra.scripts.bench.pages.examples_page docs/examples"
        )
