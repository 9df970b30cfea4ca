"""Ctrl-C at ten stages of verbs, in a process of their own: one line, exit code 130, and nothing half-written."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from haustra.models.anatomy.store import save_colon
from haustra.scripts.main import INTERRUPTED, SUCCESS
from tests.tube_colon import straight_tube

_BEGIN = """import signal
import sys
from haustra.scripts.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start what runs in the background with Ctrl-C ignored
print("begun", flush=True)
sys.exit(main(sys.argv[1:]))
"""
_STUDY = """question = "scope"
title = "interrupted"
[base]
design = "adult"
[options]
seconds = 600.0
mesentery = true
[[variables]]
name = "EI"
path = "design.shaft.*.flexural_rigidity"
unit = "N m^2"
nominal = 0.03
low = 0.02
high = 0.05
[conditions]
colon = ["COLON"]
friction = [0.1]
[sampler]
kind = "sobol"
count = 64
seed = 0
[[objectives]]
score = "reach"
goal = "maximise"
"""


@pytest.fixture(scope="module")
def colon(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("colon")
    save_colon(straight_tube(), folder)
    return folder


def _interrupted(words: list[str], after: float) -> tuple[int, str]:
    """Exit code and what was printed of a call that is interrupted so many seconds after the program began."""
    command = [sys.executable, "-c", _BEGIN, *words]
    quiet = {"env": dict(os.environ, OPENBLAS_NUM_THREADS="1"), "text": True}
    call = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **quiet)
    assert call.stdout is not None and call.stdout.readline() == "begun\n"
    try:
        said, _ = call.communicate(timeout=after)
    except subprocess.TimeoutExpired:
        call.send_signal(signal.SIGINT)
        said, _ = call.communicate(timeout=120)
    # Where an interruption met code that C ran, Python ends by the signal itself: a shell calls both 130.
    return INTERRUPTED if call.returncode == -signal.SIGINT else call.returncode, said


# tests/scripts/test_run.py interrupts a run when it is done and being written, without waiting for that.
@pytest.mark.parametrize("after", [0.3, *(pytest.param(more, marks=pytest.mark.thorough) for more in (1.0, 2.0, 7.0))])
def test_a_run_says_in_one_line_that_it_was_interrupted(after: float, colon: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    code, said = _interrupted(["run", "--colon", str(colon), "--seconds", "36000", "-o", str(out)], after)
    assert "Traceback" not in said, said
    if after > 3.0 and (out / "scores.json").is_file():  # it was through, if perhaps not out of Python yet
        assert code in (SUCCESS, INTERRUPTED) and (out / "report.html").is_file(), said
        return
    assert code == INTERRUPTED and said.rstrip().endswith("haustra: interrupted; nothing was written."), said
    assert not out.exists()


@pytest.mark.parametrize(
    "after",
    [
        1.0,
        pytest.param(3.0, marks=pytest.mark.thorough),
        pytest.param(6.0, marks=pytest.mark.thorough),
        pytest.param(9.0, marks=pytest.mark.thorough),
    ],
)
def test_a_sweep_says_so_too_and_goes_on_afterwards(after: float, colon: Path, tmp_path: Path) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "sweep"
    study.write_text(_STUDY.replace("COLON", str(colon)), encoding="utf-8")
    words = ["sweep", str(study), "--backend", "linear", "--no-tables", "-o", str(out)]
    code, said = _interrupted(words, after)
    assert code in (INTERRUPTED, SUCCESS) and "Traceback" not in said, said
    if (out / "sweep.sqlite").exists():
        code, said = _interrupted([*words, "--resume"], 4.0)
        assert code in (INTERRUPTED, SUCCESS) and "Traceback" not in said, said
