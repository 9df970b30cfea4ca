"""`haustra evaluate` of drivers of a device that is no scope."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from haustra.errors import InvalidOptionError

_HONOURED = (
    *("drivers", "device", "output", "colons", "colon_folders", "episodes", "friction", "mesentery", "seconds"),
    *("backend", "threads", "processes", "video", "json"),
)
"""Options of `haustra evaluate` that episodes of any device honour; pictures are of scopes."""
_OWN = "own"
"""Name of the driver that a device brings."""
_WORLDS = 32
"""Episodes that run at once; engineering choice: steps of more cost as much each."""


def evaluate_any(asked: Any, device: str) -> dict[str, Any]:
    """Let drivers of a device drive it, and write the folder.

    Args:
        asked: a `haustra.scripts.evaluate.Evaluate`.
        device: name of the device, or its file.

    Raises:
        InvalidOptionError: naming an option that devices other than scopes do not honour, or a driver that is none of
            this device.
    """
    from haustra.envs.learning.evaluate_device import evaluate_device
    from haustra.envs.learning.figures import draw_device_evaluations
    from haustra.envs.tasks.device_task import DeviceRules, DeviceTask
    from haustra.files import prepare_folder, write_json
    from haustra.provenance import Provenance, backend_record
    from haustra.scripts.console import progress_bar

    for entry in fields(asked):
        value = getattr(asked, entry.name)
        if entry.name not in _HONOURED and value != entry.default:
            raise InvalidOptionError(
                f"Episodes of '{device}' do not honour --{entry.name.replace('_', '-')}: leave it out."
            )
    made = [_driver(name, device) for name in asked.drivers]
    rules = next((own for _, own in made if own is not None), DeviceRules(device=device, mesentery=True))
    given = {"friction": asked.friction, "mesentery": asked.mesentery, "seconds": asked.seconds}
    rules = replace(rules, **{name: value for name, value in given.items() if value is not None})
    folder = None if asked.output is None else prepare_folder(asked.output)
    colons, backend = _colons(asked), asked.backend or "native"
    done = []
    for name, (make, own) in zip(asked.drivers, made, strict=True):
        paced = rules if own is None else replace(rules, control_interval=own.control_interval)
        worlds = min(_WORLDS, len(colons) * asked.episodes)
        task = DeviceTask(paced, colons=colons, worlds=worlds, threads=asked.threads, backend=backend)
        with progress_bar(name, len(colons) * asked.episodes, unit="episodes") as advance:
            tell = lambda count, _, advance=advance: advance(count, "")  # noqa: E731
            done.append(evaluate_device(make, name, task, episodes=asked.episodes, progress=tell))
    rows = {one.driver: one.summary() | _further(one, done) for one in done}
    if folder is not None:
        provenance = Provenance({}, {"rules": rules.to_json()}, backend=backend_record(backend)).to_json()
        result = {"rules": rules.to_json(), "drivers": list(rows.values()), "provenance": provenance}
        write_json(folder / "evaluation.json", result)
        write_json(folder / "episodes.json", {one.driver: one.rows() for one in done})
        draw_device_evaluations(done, folder / "evaluation.png")
    return rows


def _driver(name: str, device: str) -> tuple[Any, Any]:
    """How to make the driver, and the rules that it was trained by; the driver that a device brings has none."""
    from haustra.envs.learning.drivers import PolicyDriver
    from haustra.envs.learning.policy import ABOUT, load_any_policy, policy_folder
    from haustra.envs.tasks.drivers import OwnDriver

    if name == _OWN:
        return OwnDriver, None
    folder = policy_folder(name)
    if not (folder / ABOUT).is_file():
        raise InvalidOptionError(f"Driver '{name}' of '{device}' is neither '{_OWN}' nor the folder of a policy.")
    policy = load_any_policy(folder)
    if policy.drives is None or policy.drives.device != device:
        driven = "a scope" if policy.drives is None else f"'{policy.drives.device}'"
        raise InvalidOptionError(f"The policy '{name}' drives {driven}, not '{device}': name another.")
    return (lambda _: PolicyDriver(policy)), policy.drives


def _colons(asked: Any) -> list[Any]:
    """Held-out grown colons, or those of folders."""
    from haustra.envs.tasks.bank import grown_bank
    from haustra.envs.tasks.config import HELD_OUT_SEEDS
    from haustra.models.anatomy.store import load_colon
    from haustra.models.devices.scope.library import named_design
    from haustra.scripts.console import progress_bar

    if asked.colon_folders:
        return [load_colon(Path(folder)) for folder in asked.colon_folders]
    with progress_bar("grow", asked.colons, unit="colons") as advance:
        seeds = range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + asked.colons)
        tell = lambda done: advance(done, "")  # noqa: E731
        bank = grown_bank(seeds, named_design("adult"), processes=asked.processes, progress=tell)
    return [case.colon() for case in bank.cases]


def _further(one: Any, done: list[Any]) -> dict[str, Any]:
    """How much further a driver came than each other, where there are several."""
    others = [other for other in done if other is not one]
    return {"further_than": [one.further_than(other) for other in others]} if others else {}
