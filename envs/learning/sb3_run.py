"""Training with Stable-Baselines3 on the worlds of one process."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.utils import set_random_seed

from haustra.envs.learning.checkpoint import restore, save_checkpoint
from haustra.envs.learning.models import build_model, hold_actor, normalised, policy_of, warm_up
from haustra.envs.learning.policy import save_policy
from haustra.envs.learning.sb3_state import buffer_of, packed, refill, unpack
from haustra.envs.learning.schedule import SAVE_EVERY, curve_of, learning_rate, made_by, perforation_force
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.sb3 import TaskVecEnv
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.files import write_json

Progress = Callable[[int, str], None]
"""Told environment steps done, and a note."""


class Sb3Run:
    """One model and its worlds."""

    def __init__(
        self,
        training: Training,
        folder: Path,
        task: ScopeTask | DeviceTask,
        document: dict[str, Any] | None,
        tensorboard: bool,
        progress: Progress,
        deadline: float | None,
    ) -> None:
        self._deadline = deadline
        self.training, self.folder, self.task, self.progress = training, folder, task, progress
        worlds = TaskVecEnv(task, flat=True, stagger=training.stagger)
        self.normaliser = normalised(training, worlds)
        self.worlds = self.normaliser or worlds
        set_random_seed(training.seed)
        self.model = build_model(training, self.worlds, folder / "tensorboard" if tensorboard else None)
        if not tensorboard:
            self.model.set_logger(Logger(None, []))  # left to itself it makes a temporary folder that nobody removes
        self.model.lr_schedule = lambda _: learning_rate(training, self.model.num_timesteps)
        self.leg = 0
        if document is None:
            write_json(folder / "training.json", training.to_json())
            if training.imitate or training.demonstrations:
                late = lambda: deadline is not None and time.monotonic() > deadline  # noqa: E731
                warm_up(self.model, training, task, progress, late)
        else:
            restore(folder, document, self._restore(document))
            self.leg = int(document["leg"])
            self._take_up(document.get("normaliser"))
        self.curve = curve_of(training, folder, steps=self.model.num_timesteps)

    def go(self) -> dict[str, Any]:
        """Learn leg by leg until the steps are done or time is up."""
        training, model = self.training, self.model
        watch = _Watch(self, self._deadline)
        while model.num_timesteps < training.steps and not watch.late:
            set_random_seed(training.seed + 1000 * (self.leg + 1), using_cuda=training.device == "cuda")
            hold_actor(model, training, self.leg)
            self.worlds.seed(training.seed + 1_000_000 * (self.leg + 1))
            model._last_obs = None
            count = min(training.leg, training.steps - model.num_timesteps)
            model.learn(count, callback=watch, reset_num_timesteps=False, progress_bar=False)
            self.leg += 1
            self.save()
        self.save_policy()
        done = {"steps": model.num_timesteps, "legs": self.leg, "policy": str(self.folder), "time_up": watch.late}
        return done | {"steps_per_second": watch.rate(), **self.curve.last()}

    def save(self) -> None:
        """Write a checkpoint from which the next leg can begin."""
        tensors, plain = packed(self.model)
        document: dict[str, Any] = {
            "steps_done": self.model.num_timesteps,
            "leg": self.leg,
            "training": self.training.to_json(),
            "plain": plain,
        }
        if self.normaliser is not None:
            seen, paid = self.normaliser.obs_rms, self.normaliser.ret_rms
            document["normaliser"] = {
                "seen": [seen.mean.tolist(), seen.var.tolist(), float(seen.count)],
                "paid": [float(paid.mean), float(paid.var), float(paid.count)],
            }
        save_checkpoint(self.folder, tensors, document, buffer_of(self.model))

    def save_policy(self) -> None:
        """Write the policy as it is now."""
        about = made_by(self.training, self.model.num_timesteps)
        save_policy(self.folder, policy_of(self.model, self.training, about, self.normaliser))

    def ease(self) -> None:
        """Set the perforation limit of the episodes that begin from now on."""
        if isinstance(self.task, ScopeTask):
            self.task.bears = perforation_force(self.training, self.model.num_timesteps)

    def _restore(self, document: dict[str, Any]) -> Callable[[dict[str, torch.Tensor], Path], None]:
        def take(tensors: dict[str, torch.Tensor], buffer: Path) -> None:
            unpack(self.model, tensors, document["plain"])
            refill(self.model, buffer)
            self.model.num_timesteps = int(document["steps_done"])

        return take

    def _take_up(self, kept: dict[str, Any] | None) -> None:
        if self.normaliser is None or kept is None:
            return
        for entry, values in ((self.normaliser.obs_rms, kept["seen"]), (self.normaliser.ret_rms, kept["paid"])):
            entry.mean, entry.var, entry.count = np.array(values[0]), np.array(values[1]), float(values[2])


class _Watch(BaseCallback):
    """Notes episodes that end, says how far it is, keeps what was learned, and stops when time is up."""

    def __init__(self, run: Sb3Run, deadline: float | None) -> None:
        super().__init__()
        self._run, self._deadline = run, deadline
        self._began = self._kept = time.monotonic()
        self._steps = run.model.num_timesteps
        self.late = False

    def rate(self) -> float:
        """Environment steps in a second of wall clock, learning included."""
        return (self._run.model.num_timesteps - self._steps) / (time.monotonic() - self._began)

    def _on_rollout_start(self) -> None:
        self._run.ease()
        if self._run.training.backend != "native" and time.monotonic() > self._kept + SAVE_EVERY:
            self._run.leg += 1  # whoever goes on from here draws other episodes
            self._run.save()
            self._run.save_policy()
            self._kept = time.monotonic()

    def _on_rollout_end(self) -> None:
        self.late = self._deadline is not None and time.monotonic() > self._deadline

    def _on_step(self) -> bool:
        ended = [info for info in self.locals["infos"] if "episode" in info]
        if ended:
            self._run.curve.add(self.num_timesteps, [self._row(info) for info in ended])
            best = np.mean([info["progress"] for info in ended])
            self._run.progress(self.num_timesteps, f"progress {best:.2f}")
        elif self.n_calls % 20 == 0:
            self._run.progress(self.num_timesteps, "")
        return not self.late

    def _on_training_end(self) -> None:
        self._run.curve.add(self.num_timesteps, [])

    def _row(self, info: dict[str, Any]) -> list[float]:
        """An episode that has ended, as the curve has it."""
        named = {"return": info["episode"]["r"], "seconds": info["time"]}
        return [float(named[name] if name in named else info[name]) for name in self._run.curve.episode]
