"""Training with Stable-Baselines3 on the worlds of one process."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import set_random_seed

from haustra.envs.learning.checkpoint import load_checkpoint, restore, save_checkpoint
from haustra.envs.learning.imitate import imitate
from haustra.envs.learning.policy import MlpPolicy, save_policy
from haustra.envs.learning.settings import Training
from haustra.envs.sb3 import ScopeVecEnv
from haustra.envs.tasks.bank import Bank
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.files import prepare_folder, write_json
from haustra.provenance import Provenance

Progress = Callable[[int, str], None]
"""Told environment steps done, and a note."""


def train(
    training: Training,
    folder: Path,
    *,
    resume: bool = False,
    bank: Bank | None = None,
    threads: int = 2,
    tensorboard: bool = False,
    progress: Progress = lambda done, note: None,
) -> dict[str, Any]:
    """Train, leaving checkpoints, the learning curve and the policy in a folder.

    Every leg begins with new episodes and random streams made from seed and leg, so that a run that was interrupted
    and resumed does, to the bit, what it would have done.

    Args:
        training: what to do.
        folder: for everything.
        resume: go on from the folder's last checkpoint, with its configuration.
        bank: colons; grown from the task's seeds when None.
        threads: for physics.
        tensorboard: write TensorBoard's logs too.
        progress: told how far it is.

    Returns:
        What it came to, as JSON values.

    Raises:
        InvalidOptionError: when the folder holds another run and `resume` is not set.
    """
    prepare_folder(folder)
    torch.set_num_threads(1)
    document: dict[str, Any] | None = None
    if resume:
        document = load_checkpoint(folder)
        steps = training.steps
        training = Training.from_json(document["training"] | {"steps": max(steps, int(document["steps_done"]))})
    elif (folder / "checkpoint.json").exists():
        raise InvalidOptionError(f"'{folder}' holds a training run: go on with --resume, or name another folder.")
    task = ScopeTask(training.task, worlds=training.worlds, threads=threads, bank=bank)
    try:
        return _train(training, folder, task, document, tensorboard, progress)
    finally:
        task.close()


def _train(training, folder: Path, task: ScopeTask, document, tensorboard: bool, progress: Progress) -> dict[str, Any]:
    worlds = ScopeVecEnv(task, flat=True)
    set_random_seed(training.seed)
    model = _model(training, worlds, folder / "tensorboard" if tensorboard else None)
    leg = 0
    if document is None:
        write_json(folder / "training.json", training.to_json())
        if training.imitate:
            _warm_up(model, training, task, progress)
    else:
        restore(folder, model, document)
        leg = int(document["leg"])
    curve = _Curve(folder / "curve.csv", fresh=document is None)
    while model.num_timesteps < training.steps:
        set_random_seed(training.seed + 1000 * (leg + 1))
        _hold_actor(model, training, leg)
        worlds.seed(training.seed + 1_000_000 * (leg + 1))
        model._last_obs = None
        count = min(training.leg, training.steps - model.num_timesteps)
        model.learn(count, callback=_Watch(curve, progress), reset_num_timesteps=False, progress_bar=False)
        leg += 1
        save_checkpoint(folder, model, {"steps_done": model.num_timesteps, "leg": leg, "training": training.to_json()})
    about = {
        "training": training.to_json(),
        "steps": model.num_timesteps,
        "provenance": Provenance(inputs={}, configuration={}).to_json(),
    }
    save_policy(folder, policy_of(model, training, about))
    return {"steps": model.num_timesteps, "legs": leg, "policy": str(folder), **curve.last()}


def policy_of(model: Any, training: Training, about: dict[str, Any]) -> MlpPolicy:
    """The deterministic policy of a model of Stable-Baselines3, as plain layers."""
    if training.algorithm == "ppo":
        parts = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    else:
        parts = [*model.actor.latent_pi, model.actor.mu]
    layers = [part for part in parts if isinstance(part, torch.nn.Linear)]
    return MlpPolicy(
        weights=tuple(layer.weight.detach().numpy().copy() for layer in layers),
        biases=tuple(layer.bias.detach().numpy().copy() for layer in layers),
        activation="tanh" if training.algorithm == "ppo" else "relu",
        squashed=training.algorithm == "sac",
        config=training.task,
        about=about,
    )


def _model(training: Training, worlds: ScopeVecEnv, log: Path | None) -> Any:
    common: dict[str, Any] = {
        "learning_rate": training.learning_rate,
        "gamma": training.gamma,
        "batch_size": training.batch,
        "seed": training.seed,
        "device": "cpu",
        "tensorboard_log": str(log) if log else None,
    }
    layers = list(training.layers)
    if training.algorithm == "ppo":
        return PPO(
            "MlpPolicy",
            worlds,
            n_steps=training.rollout,
            n_epochs=training.epochs,
            ent_coef=training.entropy,
            target_kl=training.target_kl,
            policy_kwargs={"net_arch": {"pi": layers, "vf": layers}, "log_std_init": training.log_std},
            **common,
        )
    return SAC(
        "MlpPolicy",
        worlds,
        buffer_size=training.buffer,
        train_freq=1,
        gradient_steps=2,
        learning_starts=20 * training.worlds,
        policy_kwargs={"net_arch": layers},
        **common,
    )


def _warm_up(model: Any, training: Training, task: ScopeTask, progress: Progress) -> None:
    """Learn from the follower before learning from reward."""
    if training.algorithm == "ppo":
        policy = model.policy

        def mean(seen: torch.Tensor) -> torch.Tensor:
            return policy.action_net(policy.mlp_extractor.forward_actor(seen))

        parameters = [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters()]
    else:
        actor = model.actor

        def mean(seen: torch.Tensor) -> torch.Tensor:
            return torch.tanh(actor.mu(actor.latent_pi(seen)))

        parameters = [*actor.latent_pi.parameters(), *actor.mu.parameters()]
    imitate(
        mean,
        parameters,
        task,
        steps=training.imitate,
        seed=training.seed,
        progress=lambda done, loss: progress(0, f"learning from the follower: {done} steps, error {loss:.3f}"),
    )


def _hold_actor(model: Any, training: Training, leg: int) -> None:
    """In the first leg after imitation only PPO's critic learns: a critic that knows nothing unteaches the policy."""
    if training.algorithm != "ppo":
        return
    policy = model.policy
    held = bool(training.imitate) and leg == 0 and training.steps > training.leg
    for part in (*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std):
        part.requires_grad_(not held)


class _Curve:
    """Finished episodes, as rows of a CSV file."""

    def __init__(self, path: Path, *, fresh: bool) -> None:
        self._path, self._recent = path, []
        if fresh:
            path.write_text("steps,episodes,return,progress,reached,perforated,seconds\n", encoding="utf-8")

    def add(self, steps: int, ended: list[dict[str, Any]]) -> None:
        self._recent += [
            [one["episode"]["r"], one["progress"], float(one["reached"]), float(one["perforated"]), one["time"]]
            for one in ended
        ]
        if len(self._recent) >= 16 or (not ended and self._recent):
            means = np.mean(self._recent, axis=0)
            with self._path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file).writerow([steps, len(self._recent), *(f"{value:.5g}" for value in means)])
            self._recent = []

    def last(self) -> dict[str, float]:
        with self._path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        if not rows:
            return {}
        return {f"last_{name}": float(rows[-1][name]) for name in ("return", "progress", "reached")}


class _Watch(BaseCallback):
    """Notes episodes that end, and says how far it is."""

    def __init__(self, curve: _Curve, progress: Progress) -> None:
        super().__init__()
        self._curve, self._progress = curve, progress

    def _on_step(self) -> bool:
        ended = [info for info in self.locals["infos"] if "episode" in info]
        if ended:
            self._curve.add(self.num_timesteps, ended)
            best = np.mean([info["progress"] for info in ended])
            self._progress(self.num_timesteps, f"progress {best:.2f}")
        elif self.n_calls % 20 == 0:
            self._progress(self.num_timesteps, "")
        return True

    def _on_training_end(self) -> None:
        self._curve.add(self.num_timesteps, [])
