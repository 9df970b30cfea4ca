"""Training on the worlds of one process: which colons, where from, and who learns."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from haustra.envs.learning.checkpoint import load_checkpoint
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.bank import ColonSet, grown_bank
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.files import prepare_folder
from haustra.models.devices.scope.library import named_design

Progress = Callable[[int, str], None]
"""Told environment steps done, and a note."""


def train(
    training: Training,
    folder: Path,
    *,
    resume: bool = False,
    bank: ColonSet | None = None,
    threads: int = 2,
    processes: int = 1,
    minutes: float | None = None,
    tensorboard: bool = False,
    progress: Progress = lambda done, note: None,
) -> dict[str, Any]:
    """Train, leaving checkpoints, the learning curve and the policy in a folder.

    Every leg begins with new episodes and random streams made from seed and leg, so that a run on the CPU that was
    interrupted and resumed does, to the bit, what it would have done; eyes alone go on from other episodes.

    Args:
        training: what to do.
        folder: for everything.
        resume: go on from the folder's last checkpoint, with its configuration.
        bank: colons; grown from the task's seeds when None.
        threads: for physics on the CPU.
        processes: that grow colons.
        minutes: stop cleanly, with checkpoint and policy, once that much time has passed since the call.
        tensorboard: write TensorBoard's logs too.
        progress: told how far it is.

    Returns:
        What it came to, as JSON values.

    Raises:
        InvalidOptionError: when the folder holds another run and `resume` is not set, or for TensorBoard's logs of a
            learner that writes none.
    """
    if tensorboard and training.learner != "sb3":
        raise InvalidOptionError(f"The learner '{training.learner}' writes curve.csv only: leave --tensorboard out.")
    deadline = None if minutes is None else time.monotonic() + 60 * minutes
    prepare_folder(folder)
    torch.set_num_threads(1)
    document: dict[str, Any] | None = None
    if resume:
        document = load_checkpoint(folder)
        steps = training.steps
        training = Training.from_json(document["training"] | {"steps": max(steps, int(document["steps_done"]))})
    elif (folder / "checkpoint.json").exists():
        raise InvalidOptionError(f"'{folder}' holds a training run: go on with --resume, or name another folder.")
    task = _task(training, bank, threads, processes, progress)
    try:
        if isinstance(task, DeviceTask) or training.learner == "sb3":
            from haustra.envs.learning.sb3_run import Sb3Run

            return Sb3Run(training, folder, task, document, tensorboard, progress, deadline).go()
        if training.learner == "device":
            from haustra.envs.learning.device_run import DeviceRun

            return DeviceRun(training, folder, task, document, progress).go(deadline)
        from haustra.envs.learning.eyes_run import EyesRun

        return EyesRun(training, folder, task, document, progress).go(deadline)
    finally:
        task.close()


def _task(
    training: Training, bank: ColonSet | None, threads: int, processes: int, progress: Progress
) -> ScopeTask | DeviceTask:
    """The worlds: a scope's in the bank, or another device's in its colons; grown from the task's seeds when None."""
    drives, own = training.drives, training.task
    seeds = own.seeds if drives is None else drives.seeds
    bank = bank or grown_bank(
        range(*seeds),
        named_design(own.design),
        difficulty=own.difficulty,
        processes=processes,
        progress=lambda done: progress(0, f"{done} colons grown"),
    )
    about = {"worlds": training.worlds, "threads": threads, "backend": training.backend}
    if drives is None:
        return ScopeTask(training.shown, bank=bank, **about)
    return DeviceTask(drives, colons=[case.colon() for case in bank.cases], **about)
