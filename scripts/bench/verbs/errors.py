"""`haustra bench errors`: how far every wall law and preset is off, over many colons."""

import math
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchErrors:
    """Drive one script through every way of modelling and a converged one, and state the errors as ranges over colons.

    Finished tracks are kept: a measurement that was stopped goes on. Some five processor minutes a colon and scope.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for colons, tracks, errors.json and accuracy.toml."""
    colons: int = whole(0, 100_000, default=10)
    """Number of colons grown from seed 0 on; a range over fewer than ten is not stated."""
    folders: str = ""
    """Folders of further colons, separated by commas."""
    designs: str = "adult,paediatric"
    """Names of scope designs, separated by commas."""
    laws: str = "pieces,planes,table"
    """Wall laws, separated by commas: pieces, planes, table."""
    walls: str = "prism"
    """Ways to make a wall's pieces, separated by commas: prism, coacd."""
    presets: str = "fast,balanced,accurate"
    """Names of presets, separated by commas."""
    colon: Literal["fixed", "mesentery", "both"] = "both"
    """How colons stand: fixed in space, on their mesentery, or both."""
    seconds: float = number("s", 0.02, 600.0, default=10.0)
    """Duration of the script, in simulated time [s]."""
    minutes: float | None = number("min", 0.01, 1e6, default=None)
    """Time after which no further track is begun [min]; the same command goes on from there."""
    processes: int = whole(0, 4096, default=0)
    """Number of processes at a time; as many as there are cores when 0."""
    ship: bool = False
    """Write assets/accuracy.toml too, which runs state their errors from; what is not measured now stays."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.assets import asset
        from haustra.children import cores
        from haustra.files import write_atomically, write_json
        from haustra.models.accuracy import load_measured
        from haustra.models.presets import PRESETS
        from haustra.scripts.bench.accuracy.errors import (
            Asked,
            accuracy_toml,
            measure_errors,
            ranges_of,
            refusals,
        )
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.console import progress_bar

        asked = Asked(
            grown=self.colons,
            folders=tuple(map(Path, words(self.folders))),
            designs=words(self.designs),
            laws=_known(self.laws, ("pieces", "planes", "table")),
            walls=_known(self.walls, ("prism", "coacd")),  # pyright: ignore[reportArgumentType]
            presets=_known(self.presets, tuple(PRESETS)),
            mesentery={"fixed": (False,), "mesentery": (True,), "both": (False, True)}[self.colon],
            seconds=self.seconds,
        )
        processes = self.processes or cores()
        with progress_bar("errors", 1, unit="tracks") as advance:
            own = {"processes": processes, "minutes": self.minutes or math.inf, "progress": advance}
            rows = measure_errors(asked, self.output, **own)
        where, ranges = machine(), ranges_of(rows)
        before = load_measured(asset("accuracy.toml")) if self.ship else ()
        text = accuracy_toml(ranges, asked, where, before=before)
        for path in (self.output / "accuracy.toml", *((asset("accuracy.toml"),) if self.ship else ())):
            write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
        result = {
            "ranges": [asdict(each) for each in ranges],
            "refused": refusals(rows),
            "machine": where,
        }
        write_json(self.output / "errors.json", {**result, "rows": rows})
        return result if self.json else {**{_title(each): _said(each) for each in ranges}, "refused": result["refused"]}


def words(text: str) -> tuple[str, ...]:
    """Words that are separated by commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _known(text: str, known: tuple[str, ...]) -> tuple[str, ...]:
    from haustra.errors import InvalidOptionError

    for word in words(text):
        if word not in known:
            raise InvalidOptionError(f"'{word}' is not known. Known: {', '.join(known)}.")
    return words(text)


def _title(ranges) -> str:
    hung = "mesentery" if ranges.mesentery else "fixed"
    return " ".join(part for part in (ranges.wall_law, ranges.wall, hung, ranges.preset, ranges.colon) if part)


def _said(ranges) -> str:
    wall, push, tip = ranges.wall_force, ranges.push, ranges.tip_mm
    fallen = f", {ranges.fallen} fell over" if ranges.fallen else ""
    return (
        f"wall force {100 * wall[0]:.2g} to {100 * wall[1]:.2g} %, push {100 * push[0]:.2g} to {100 * push[1]:.2g} %, "
        f"tip {tip[0]:.2g} to {tip[1]:.2g} mm, {ranges.colons} colons{fallen}"
    )
