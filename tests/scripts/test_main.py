"""The command line as a shell sees it."""

import os
import resource
import subprocess
import sys

import pytest

from haustra.scripts.main import BAD_INPUT, INTERRUPTED, SUCCESS, main
from haustra.scripts.registry import BENCHMARKS, VERBS, first_sentence, load_verb


@pytest.mark.parametrize(
    "arguments",
    [["doctor", "--json"], pytest.param(["doctor"], marks=pytest.mark.thorough), ["bench", "episodes", "--help"]],
)
def test_a_reader_that_goes_away_is_no_error(arguments: list[str]) -> None:
    """As in `haustra doctor | head -0`: nothing on stderr, exit code 0."""
    command = [sys.executable, "-m", "haustra.scripts.main", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
    assert said == b""
    assert process.returncode == 0


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_loads_and_says_what_it_does(name: str) -> None:
    verb = load_verb(name)
    assert callable(verb) and verb.__dataclass_params__.frozen
    about = " ".join((verb.__doc__ or "").split())
    assert about.startswith(first_sentence(name).removesuffix("."))


def test_the_overview_names_verbs_and_the_list_benchmarks(capsys) -> None:
    assert main(["--help"]) == SUCCESS
    overview = capsys.readouterr().out
    assert sum(line.startswith("  ") for line in overview.partition("More verbs:")[0].splitlines()) <= 20
    assert all(name in overview for name in VERBS if name not in BENCHMARKS)
    assert main(["bench", "--list"]) == SUCCESS
    benchmarks = capsys.readouterr().out
    assert all(name in benchmarks for name in BENCHMARKS)
    assert main([]) == BAD_INPUT


@pytest.mark.parametrize("words", [["nope"], ["bench", "nope"], ["colon", "nope"], ["colon"], ["--nope"]])
def test_a_verb_that_is_not_known_is_refused_in_one_line(words: list[str], capsys) -> None:
    assert main(words) == BAD_INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "is not known. Known:" in said


def test_a_terminal_that_takes_ascii_only_gets_help() -> None:
    command = [sys.executable, "-m", "haustra.scripts.main", "--help"]
    plain = {**os.environ, "PYTHONIOENCODING": "ascii"}
    finished = subprocess.run(command, capture_output=True, text=True, env=plain, check=True)
    assert finished.stderr == "" and "haustra VERB --help" in finished.stdout


def test_help_takes_at_most_0_3_seconds_of_a_processor() -> None:
    """Least of two calls, since the first may have to compile modules: 0.3 s is asked for."""
    taken = []
    for _ in range(2):
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-m", "haustra.scripts.main", "--help"], capture_output=True, check=True)
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        taken.append(ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime)
    assert min(taken) <= 0.3


def test_an_interruption_is_one_line_before_a_verb_begins_and_while_modules_load(monkeypatch, capsys) -> None:
    """Python says ImportError of a module that is interrupted while it initialises."""

    def interrupted(name: str) -> None:
        raise KeyboardInterrupt

    def loading(self) -> None:
        raise ImportError("initialization failed") from KeyboardInterrupt()

    call = ["doctor"]
    with monkeypatch.context() as patch:
        patch.setattr("haustra.scripts.main.load_verb", interrupted)
        assert main(call) == INTERRUPTED
    monkeypatch.setattr(load_verb("doctor"), "__call__", loading)
    assert main(call) == INTERRUPTED
    assert capsys.readouterr().err == "haustra: interrupted; nothing was written.\n" * 2


def test_shells_are_offered_verbs_options_and_choices(capsys) -> None:
    assert main(["completion", "bash"]) == SUCCESS
    script = capsys.readouterr().out
    typed = {
        "haustra co": "colon",
        "haustra colon g": "grow",
        "haustra run --preset f": "fast",
        "haustra bench g": "gas",
    }
    ask = "COMP_WORDS=({}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _haustra; echo ${{COMPREPLY[@]}}"
    program = "\n".join([script, *map(ask.format, typed)])
    offered = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(offered) == len(typed)
    assert all(word in line.split() for line, word in zip(offered, typed.values(), strict=True))
    assert main(["completion", "fish"]) == SUCCESS
    assert "__haustra_verb run' -l preset -xa 'fast balanced accurate'" in capsys.readouterr().out


def test_mujoco_is_loaded_without_looking_for_a_window_library() -> None:
    """It does so by running another Python, whose complaint is printed if a verb is interrupted then."""
    program = "import sys; from haustra.scripts.main import main; main([]); import mujoco; print('glfw' in sys.modules)"
    plain = {name: value for name, value in os.environ.items() if name != "MUJOCO_GL"}
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=plain, check=True)
    assert finished.stdout.splitlines()[-1] == "False"
