"""Ask every backend that this machine has the same questions, and say of the others why they are absent."""

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from haustra.envs.sim.warp_setup import use_warp
from haustra.envs.tasks.bank import ColonSet
from haustra.scripts.bench.agreement.free import Mover, by_linear, by_warp, compare_free, trials
from haustra.scripts.bench.agreement.insertions import Runs, compare_insertions, insertions
from haustra.scripts.bench.agreement.pads import NO_TREADS, compare_pads
from haustra.scripts.bench.agreement.row import Agreement
from haustra.scripts.bench.machine import machine

BACKENDS = ("linear", "warp")
"""What is held against the native backend."""
PARTS = ("free", "pads", "insertions")


def absent_backends() -> dict[str, str]:
    """Backends that are not installed, and what to do."""
    return {} if find_spec("warp") else {"warp": "not installed here: pip install 'haustra[warp]'"}


def compare_backends(
    bank: ColonSet,
    parts: Sequence[str],
    *,
    backends: Sequence[str] = BACKENDS,
    mesentery: Sequence[bool] = (False, True),
    seeds: int,
    seconds: float,
    processes: int,
    folder: Path | None = None,
    device: str | None = None,
    progress: Callable[[float, str], None] = lambda done, note: None,
) -> list[Agreement]:
    """Rows of the table.

    Args:
        bank: colons and scope.
        parts: of `PARTS`.
        backends: of `BACKENDS`.
        mesentery: kinds of colons for insertions: fixed, on their mesentery.
        seeds: of insertions.
        seconds: longest insertion [s].
        processes: of the native backend.
        folder: where finished insertions are kept and looked for.
        device: as Warp names it.
        progress: told parts done.
    """
    absent: dict[str, str] = dict.fromkeys(set(BACKENDS) - set(backends), "not asked for") | absent_backends()
    rows = []
    for done, part in enumerate(parts):
        progress(done, part)
        if part == "free":
            movers: dict[str, Mover | str] = {
                "linear": by_linear,
                "warp": lambda trial: by_warp(trial, device=device),
                **absent,
            }
            for trial in trials(bank.cases[0].colon(), bank.design):
                rows += compare_free(trial, movers)
        elif part == "pads":
            rows += compare_pads({"linear": NO_TREADS, **absent}, device=device)
        else:
            for hung in mesentery:
                rows += _insertions(
                    bank,
                    absent,
                    mesentery=hung,
                    seeds=seeds,
                    seconds=seconds,
                    processes=processes,
                    folder=folder,
                    progress=lambda share, note, done=done: progress(done + share, f"insertions, {note}"),
                )
    progress(len(parts), "")
    return rows


def _insertions(bank: ColonSet, absent: dict[str, str], *, mesentery: bool, **asked: Any) -> list[Agreement]:
    """Rows for one kind of colon; where the native backend refuses it, there is nothing to compare with."""
    known = "nothing to compare"
    if len(absent) < len(BACKENDS):
        known = insertions(bank, backend="native", mesentery=mesentery, **asked)
    if isinstance(known, str):
        refused: dict[str, Runs | str] = {backend: absent.get(backend, f"native: {known}") for backend in BACKENDS}
        return compare_insertions(None, refused, mesentery=mesentery)
    found = {
        backend: absent.get(backend) or insertions(bank, backend=backend, mesentery=mesentery, **asked)
        for backend in BACKENDS
    }
    return compare_insertions(known, found, mesentery=mesentery)


def devices() -> dict[str, Any]:
    """Date, versions, processor, and the devices that the backends compute on."""
    told: dict[str, Any] = dict(machine())
    if not absent_backends():
        import jax
        import warp as wp

        use_warp()  # before Warp tells of itself on the standard output, where a JSON document goes
        told["jax_device"] = jax.devices()[0].device_kind
        told["warp"], told["warp_device"] = wp.__version__, wp.get_device().name
    return told
