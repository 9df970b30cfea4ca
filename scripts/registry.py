"""Every verb of the command line, by name: where it is found, and what it says of itself.

No verb is imported before it is asked for, so that `haustra --help` answers at once.
"""

import ast
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_SCRIPTS, _BENCH = "haustra.scripts", "haustra.scripts.bench.verbs"

GROUPS: Mapping[str, Mapping[str, str]] = {
    "Make a colon": {
        "colon grow": f"{_SCRIPTS}.grow:ColonGrow",
        "colon import": f"{_SCRIPTS}.colon:ColonImport",
        "wall": f"{_SCRIPTS}.wall:WallBuild",
    },
    "Drive a device through it": {
        "run": f"{_SCRIPTS}.run:Run",
        "drive": f"{_SCRIPTS}.drive:Drive",
        "view": f"{_SCRIPTS}.view:View",
        "export": f"{_SCRIPTS}.export:Export",
    },
    "Compare and improve designs": {
        "compare": f"{_SCRIPTS}.compare:Compare",
        "sweep": f"{_SCRIPTS}.sweep:Sweep",
    },
    "Let policies learn to drive": {
        "train": f"{_SCRIPTS}.train:Train",
        "evaluate": f"{_SCRIPTS}.evaluate:Evaluate",
    },
    "This machine": {"doctor": f"{_SCRIPTS}.doctor:Doctor"},
}
"""Verbs that a newcomer needs, in the order of the overview: module and class of each. The class is a frozen dataclass
of options; calling an instance does the work and returns JSON values, or None where it has said all there is."""

FURTHER: Mapping[str, Mapping[str, str]] = {
    "colons": {"colon check": f"{_SCRIPTS}.colon_check:ColonCheck"},
    "runs": {
        "report": f"{_SCRIPTS}.report:Report",
        "record": f"{_SCRIPTS}.record:Record",
        "replay": f"{_SCRIPTS}.replay:Replay",
        "dataset": f"{_SCRIPTS}.dataset:Dataset",
    },
    "studies": {
        "optimise": f"{_SCRIPTS}.sweep:Optimise",
        "sensitivity": f"{_SCRIPTS}.sweep:Sensitivity",
        "cohort": f"{_SCRIPTS}.cohort:Cohort",
        "propulsion": f"{_SCRIPTS}.propulsion:Propulsion",
        "tread fem": f"{_SCRIPTS}.tread:TreadFem",
    },
    "learning": {"train curves": f"{_SCRIPTS}.train_curves:TrainCurves"},
    "the clinic": {
        "trials": f"{_SCRIPTS}.trials:Trials",
        "credibility": f"{_SCRIPTS}.credibility:Credibility",
        "imager export": f"{_SCRIPTS}.imager:ImagerExport",
        "imager score": f"{_SCRIPTS}.imager:ImagerScore",
    },
    "this shell": {"completion": f"{_SCRIPTS}.completion:Completion"},
}
"""Verbs for those who know these: the overview names them, and each says by --help what it does."""

BENCHMARKS: Mapping[str, str] = {
    "bench": f"{_BENCH}.all:BenchAll",
    "bench accuracy": f"{_BENCH}.accuracy:BenchAccuracy",
    "bench agreement": f"{_BENCH}.agreement:BenchAgreement",
    "bench cells": f"{_BENCH}.cells:BenchCells",
    "bench contracts": f"{_BENCH}.contracts:BenchContracts",
    "bench cores": f"{_BENCH}.cores:BenchCores",
    "bench cost": f"{_BENCH}.cost:BenchCost",
    "bench device": f"{_BENCH}.device:BenchDevice",
    "bench device-errors": f"{_BENCH}.device_errors:BenchDeviceErrors",
    "bench drivers": f"{_BENCH}.drivers:BenchDrivers",
    "bench episodes": f"{_BENCH}.episodes:BenchEpisodes",
    "bench errors": f"{_BENCH}.errors:BenchErrors",
    "bench front": f"{_BENCH}.front:BenchFront",
    "bench fuzz": f"{_BENCH}.fuzz:BenchFuzz",
    "bench gas": f"{_BENCH}.gas:BenchGas",
    "bench gradients": f"{_BENCH}.gradients:BenchGradients",
    "bench grown": f"{_BENCH}.grown:BenchGrown",
    "bench hands": f"{_BENCH}.hands:BenchHands",
    "bench injury": f"{_BENCH}.injury:BenchInjury",
    "bench motion": f"{_BENCH}.motion:BenchMotion",
    "bench profile": f"{_BENCH}.profile:BenchProfile",
    "bench linear": f"{_BENCH}.linear:BenchLinear",
    "bench pushes": f"{_BENCH}.pushes:BenchPushes",
    "bench reach": f"{_BENCH}.reach:BenchReach",
    "bench rigs": f"{_BENCH}.rigs:BenchRigs",
    "bench rods": f"{_BENCH}.rods:BenchRods",
    "bench sight": f"{_BENCH}.sight:BenchSight",
    "bench skip": f"{_BENCH}.skip:BenchSkip",
    "bench stability": f"{_BENCH}.stability:BenchStability",
    "bench steps": f"{_BENCH}.steps:BenchSteps",
    "bench teaching": f"{_BENCH}.teaching:BenchTeaching",
    "bench tracked": f"{_BENCH}.tracked:BenchTracked",
    "bench ultrathin": f"{_BENCH}.ultrathin:BenchUltrathin",
    "bench view": f"{_BENCH}.view:BenchView",
    "bench worlds": f"{_BENCH}.worlds:BenchWorlds",
}
"""Benchmarks likewise; `bench` alone runs those whose results the documentation shows."""

VERBS: Mapping[str, str] = {
    name: place for group in (*GROUPS.values(), *FURTHER.values(), BENCHMARKS) for name, place in group.items()
}


def load_verb(name: str) -> type[Any]:
    """Import the class of a verb of `VERBS`."""
    module, _, found = VERBS[name].partition(":")
    return getattr(import_module(module), found)


def first_sentence(name: str) -> str:
    """What a verb's class says first of itself, read from its file without importing it."""
    module, _, wanted = VERBS[name].partition(":")
    spec = find_spec(module)
    assert spec is not None and spec.origin is not None, module
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    classes = (node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == wanted)
    about = " ".join((ast.get_docstring(next(classes)) or "").partition("\n\n")[0].split())
    sentence = about.partition(". ")[0]
    return sentence if sentence.endswith((".", "?")) else f"{sentence}."
