"""The command line: parse, one call, print."""

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from haustra.errors import HaustraError
from haustra.scripts.console import summary

SUCCESS, BAD_INPUT, DIVERGED = 0, 2, 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit code: 0 success, 2 bad input, 3 a simulation that diverged."""
    import tyro

    verbs = _verbs()
    try:
        verb: Any = tyro.extras.subcommand_cli_from_dict(
            verbs,
            prog="haustra",
            description="Simulated colons for designing robotic colonoscopes, on MuJoCo.",
            args=_join_verb(sys.argv[1:] if arguments is None else arguments, verbs),
        )
    except BrokenPipeError:  # of `--help | head`
        _stop_printing()
        return SUCCESS
    try:
        result = verb()
    except HaustraError as error:
        print(f"haustra: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("haustra: interrupted; what was finished is kept.", file=sys.stderr)
        return 130
    try:
        if verb.json:
            print(json.dumps(result, allow_nan=False))
        else:
            summary(result)
        sys.stdout.flush()
    except BrokenPipeError:
        _stop_printing()
    return DIVERGED if result.get("outcome") == "diverged" else SUCCESS


def _stop_printing() -> None:
    """The reader has gone (`| head`): whatever is still buffered goes nowhere, so that closing down says nothing."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _join_verb(arguments: Sequence[str], verbs: Mapping[str, object]) -> list[str]:
    """The arguments with a verb of two words as one, which is how the parser knows it."""
    words = " ".join(arguments[:2])
    return [words, *arguments[2:]] if len(arguments) > 1 and words in verbs else list(arguments)


def _verbs() -> dict[str, Callable[..., Any]]:
    """Every verb is a frozen dataclass of options; calling it does the work and returns JSON values."""
    from haustra.scripts.bench.verbs.accuracy import BenchAccuracy
    from haustra.scripts.bench.verbs.agreement import BenchAgreement
    from haustra.scripts.bench.verbs.all import BenchAll
    from haustra.scripts.bench.verbs.cores import BenchCores
    from haustra.scripts.bench.verbs.cost import BenchCost
    from haustra.scripts.bench.verbs.episodes import BenchEpisodes
    from haustra.scripts.bench.verbs.grown import BenchGrown
    from haustra.scripts.bench.verbs.profile import BenchProfile
    from haustra.scripts.bench.verbs.pushes import BenchPushes
    from haustra.scripts.bench.verbs.rigs import BenchRigs
    from haustra.scripts.bench.verbs.rods import BenchRods
    from haustra.scripts.bench.verbs.skip import BenchSkip
    from haustra.scripts.bench.verbs.stability import BenchStability
    from haustra.scripts.bench.verbs.tracked import BenchTracked
    from haustra.scripts.bench.verbs.view import BenchView
    from haustra.scripts.bench.verbs.worlds import BenchWorlds
    from haustra.scripts.colon import ColonImport
    from haustra.scripts.colon_check import ColonCheck
    from haustra.scripts.doctor import Doctor
    from haustra.scripts.evaluate import Evaluate
    from haustra.scripts.grow import ColonGrow
    from haustra.scripts.propulsion import Propulsion
    from haustra.scripts.report import Report
    from haustra.scripts.run import Run
    from haustra.scripts.sweep import Optimise, Sensitivity, Sweep
    from haustra.scripts.train import Train
    from haustra.scripts.train_curves import TrainCurves
    from haustra.scripts.tread import TreadFem
    from haustra.scripts.view import View
    from haustra.scripts.wall import WallBuild

    return {
        "colon import": ColonImport,
        "colon grow": ColonGrow,
        "colon check": ColonCheck,
        "wall": WallBuild,
        "tread fem": TreadFem,
        "propulsion": Propulsion,
        "run": Run,
        "sweep": Sweep,
        "optimise": Optimise,
        "sensitivity": Sensitivity,
        "report": Report,
        "view": View,
        "bench": BenchAll,
        "bench rods": BenchRods,
        "bench cost": BenchCost,
        "bench accuracy": BenchAccuracy,
        "bench skip": BenchSkip,
        "bench profile": BenchProfile,
        "bench stability": BenchStability,
        "bench tracked": BenchTracked,
        "bench rigs": BenchRigs,
        "bench pushes": BenchPushes,
        "bench grown": BenchGrown,
        "bench view": BenchView,
        "bench worlds": BenchWorlds,
        "bench agreement": BenchAgreement,
        "bench cores": BenchCores,
        "bench episodes": BenchEpisodes,
        "train": Train,
        "train curves": TrainCurves,
        "evaluate": Evaluate,
        "doctor": Doctor,
    }


if __name__ == "__main__":
    sys.exit(main())
