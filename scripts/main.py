"""The command line: parse, one call, print."""

import io
import json
import os
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.errors import HaustraError
from haustra.scripts.console import one_line, summary
from haustra.scripts.interruption import interruption_kept
from haustra.scripts.registry import BENCHMARKS, FURTHER, GROUPS, VERBS, first_sentence, load_verb

SUCCESS, BAD_INPUT, DIVERGED, INTERRUPTED = 0, 2, 3, 130
PROGRAM = "haustra"
BENCH, LIST = "bench", "--list"
ABOUT = ("Simulated colons for designing robotic colonoscopes, on MuJoCo.", "")
HINT = f"{PROGRAM} VERB --help says what each takes; {PROGRAM} {BENCH} {LIST} names the benchmarks."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit code: 0 success, 2 bad input, 3 diverged, 130 interrupted."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    # Verbs draw in processes of their own: MuJoCo need not look for a window library, which it does by running another
    # Python for a tenth of a second, whose complaint would be printed if it were interrupted then.
    os.environ.setdefault("MUJOCO_GL", "disable")
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="replace")  # a terminal that takes ASCII only gets question marks
        with interruption_kept():
            name = verb_of(words)
            return _overview(words) if name is None else _call(name, words[len(name.split()) :])
    except BaseException as error:
        if not stems_from_interruption(error):
            raise
        return _interrupted(None)  # before the verb began, or after it ended


def _call(name: str, words: list[str]) -> int:
    """Run a verb with its arguments."""
    import tyro

    from haustra.fields import require_declared

    try:
        verb: Any = tyro.cli(load_verb(name), prog=f"{PROGRAM} {name}", args=words)
    except BrokenPipeError:  # of `--help | head`
        _stop_printing()
        return SUCCESS
    output: Path | None = getattr(verb, "output", None)
    made = _missing_folders(output)
    try:
        require_declared(verb, name=lambda field: f"--{field.replace('_', '-')}")
        result = verb()
    except HaustraError as error:
        _remove_empty(made)
        print(f"haustra: {one_line(str(error))}", file=sys.stderr)
        return BAD_INPUT
    except BaseException as error:
        if not stems_from_interruption(error):
            raise
        _remove_empty(made)
        return _interrupted(output)
    try:
        if result is None:  # a verb that served has said what there was to say
            pass
        elif verb.json:
            print(json.dumps(result, allow_nan=False))
        else:
            summary(result)
        sys.stdout.flush()
    except BrokenPipeError:
        _stop_printing()
    return DIVERGED if result is not None and result.get("outcome") == "diverged" else SUCCESS


def stems_from_interruption(error: BaseException | None) -> bool:
    """Whether an error is an interruption, or what others made of one: compiled modules raise an error of their own."""
    seen: list[BaseException] = []
    while error is not None and error not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.append(error)
        error = error.__cause__ or error.__context__
    return False


def _interrupted(output: Path | None) -> int:
    print(f"haustra: interrupted; {_kept(output)}.", file=sys.stderr)
    return INTERRUPTED


def _missing_folders(output: Path | None) -> list[Path]:
    """A folder that results go to and its parents, as far as they are not there yet, innermost first."""
    if output is None:
        return []
    return [folder for folder in (output, *output.parents) if not os.path.lexists(folder)]


def _kept(output: Path | None) -> str:
    """What an interrupted call leaves."""
    holds = output is not None and output.is_dir() and any(output.iterdir())
    return "what was finished is kept" if holds else "nothing was written"


def _remove_empty(folders: Sequence[Path]) -> None:
    """Leave nothing behind of a call that wrote nothing."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:  # there is something in it, or it was never made
            continue


def verb_of(words: Sequence[str]) -> str | None:
    """Name of the verb that the arguments begin with: the longest that is known, if any is."""
    two, one = " ".join(words[:2]), " ".join(words[:1])
    if two in VERBS:
        return two
    names_a_benchmark = one == BENCH and len(words) > 1 and not words[1].startswith("-")
    return one if one in VERBS and not names_a_benchmark and list(words) != [BENCH, LIST] else None


def _overview(words: Sequence[str]) -> int:
    """Say which verbs there are: on request, else as an error."""
    if list(words) in ([], ["-h"], ["--help"]):
        return _say([*ABOUT, *_listed(GROUPS), *_named(FURTHER), HINT], SUCCESS if words else BAD_INPUT)
    if list(words) == [BENCH, LIST]:
        return _say(_listed({"Benchmarks": BENCHMARKS}), SUCCESS)
    known = {name: name for name in VERBS if name.split()[0] == words[0]} or VERBS
    wrong = " ".join(words[: 1 if known is VERBS else 2])
    print(f"{PROGRAM}: '{wrong}' is not known. Known: {', '.join(known)}.", file=sys.stderr)
    return BAD_INPUT


def _listed(groups: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Lines that name the verbs of each group and say what each does."""
    lines = []
    for title, verbs in groups.items():
        lines.append(f"{title}:")
        for name in verbs:
            about = textwrap.wrap(first_sentence(name), 96)
            lines += [f"  {name:<17} {about[0]}", *(f"  {'':<17} {more}" for more in about[1:])]
        lines.append("")
    return lines


def _named(groups: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Lines that name the verbs of each group, and no more."""
    return ["More verbs:", *(f"  {title:<17} {', '.join(verbs)}" for title, verbs in groups.items()), ""]


def _say(lines: Sequence[str], code: int) -> int:
    try:
        print("\n".join(lines).rstrip())
        sys.stdout.flush()
    except BrokenPipeError:
        _stop_printing()
    return code


def _stop_printing() -> None:
    """The reader has gone (`| head`): whatever is still buffered goes nowhere, so that closing down says nothing."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
