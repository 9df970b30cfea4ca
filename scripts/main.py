"""The command line: parse, one call, print."""

import json
import sys
from collections.abc import Callable, Sequence
from typing import Any

from haustra.errors import HaustraError
from haustra.scripts.console import summary

SUCCESS, BAD_INPUT, DIVERGED = 0, 2, 3


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit code: 0 success, 2 bad input, 3 a simulation that diverged."""
    import tyro

    verb: Any = tyro.extras.subcommand_cli_from_dict(
        _verbs(),
        prog="haustra",
        description="Simulated colons for designing robotic colonoscopes, on MuJoCo.",
        args=list(sys.argv[1:] if arguments is None else arguments),
    )
    try:
        result = verb()
    except HaustraError as error:
        print(f"haustra: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("haustra: interrupted; what was finished is kept.", file=sys.stderr)
        return 130
    if verb.json:
        print(json.dumps(result, allow_nan=False))
    else:
        summary(result)
    return DIVERGED if result.get("outcome") == "diverged" else SUCCESS


def _verbs() -> dict[str, Callable[..., Any]]:
    """Every verb is a frozen dataclass of options; calling it does the work and returns JSON values."""
    from haustra.scripts.colon import ColonGrow, ColonImport
    from haustra.scripts.doctor import Doctor
    from haustra.scripts.report import Report
    from haustra.scripts.run import Run
    from haustra.scripts.view import View
    from haustra.scripts.wall import WallBuild

    return {
        "colon import": ColonImport,
        "colon grow": ColonGrow,
        "wall": WallBuild,
        "run": Run,
        "report": Report,
        "view": View,
        "doctor": Doctor,
    }


if __name__ == "__main__":
    sys.exit(main())
