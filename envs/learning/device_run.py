"""Training by PPO where the physics is: what worlds show, are paid and cost never leaves the device that steps them."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from haustra.envs.learning.checkpoint import learned, put_back, restore, save_checkpoint
from haustra.envs.learning.policy import MlpPolicy, load_policy, policy_folder, save_policy
from haustra.envs.learning.ppo import Ppo, Rollout
from haustra.envs.learning.recall import Recall, recalled_width
from haustra.envs.learning.schedule import SAVE_EVERY, curve_of, learning_rate, made_by, perforation_force
from haustra.envs.learning.settings import Training
from haustra.envs.learning.teach import teach
from haustra.envs.tasks.actions import actions_of
from haustra.envs.tasks.inspect_driver import InspectDriver
from haustra.envs.tasks.observation import sizes
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.files import write_json
from haustra.models.injury.perforation import perforation_probability

_HELD = 8
"""Rollouts in which only the critic learns, where the policy knows something and the critic nothing."""
BEST = "best"
"""Folder of the policy under which most episodes arrived, less P(perforation): prices may spoil a later one. In
withdrawals those that arrived count by the share of the mucosa that was seen."""


class DeviceRun:
    """Networks, and worlds that hand them what they show without a copy."""

    def __init__(
        self,
        training: Training,
        folder: Path,
        task: ScopeTask,
        document: dict[str, Any] | None,
        progress: Callable[[int, str], None],
    ) -> None:
        """Begin, or go on from a checkpoint's document.

        Raises:
            UnsupportedSceneError: when PyTorch finds no GPU and the training wants one.
            InvalidOptionError: when the policy to begin as sees other than the task shows, or has other layers.
        """
        if training.device == "cuda" and not torch.cuda.is_available():
            raise UnsupportedSceneError("PyTorch finds no GPU: install PyTorch with CUDA, or use backend 'linear'.")
        torch.set_float32_matmul_precision("high")
        self.training, self.folder, self.task, self._progress = training, folder, task, progress
        self._limits = {
            name: limit
            for name, limit in (("p_perforation", training.most_p_perforation), ("pain", training.most_pain))
            if limit is not None
        }
        own, shown = sizes(training.task), sizes(training.shown)
        self._own, self._beside = sorted(own), sorted(shown.keys() - own.keys())
        bare = sum(size[0] for size in own.values())
        seen = recalled_width(bare, len(actions_of(training.task)), len(training.recalls))
        hidden = sum(size[0] for size in shown.values()) - bare
        self._width = seen + hidden
        torch.manual_seed(training.seed)
        self.learner = Ppo(training, seen=seen, hidden=hidden, limits=len(self._limits))
        self.steps, self.leg, self._rollouts, self._best = 0, 0, 0, -1.0
        if document is None:
            write_json(folder / "training.json", training.to_json())
            if training.start is not None:
                self.learner.begin_as(_fitting(training))
        self.learner.to(training.device)
        if document is not None:
            restore(folder, document, lambda tensors, _: self._put_back(tensors, document))
        self._knows = training.start is not None or training.imitate > 0
        if document is None and training.imitate:
            about = {"shown": (self._own, self._beside), "limits": list(self._limits), "progress": progress}
            teach(self.learner, training, task, InspectDriver(task), **about)
        self.curve = curve_of(training, folder, steps=self.steps)
        self._seconds = {"environment": 0.0, "learning": 0.0}

    def go(self, deadline: float | None) -> dict[str, Any]:
        """Learn leg by leg until the steps are done or time is up."""
        training, late, first = self.training, False, self.steps
        began = kept = time.monotonic()
        while self.steps < training.steps and not late:
            torch.manual_seed(training.seed + 1000 * (self.leg + 1))
            self._begin(training.seed + 1_000_000 * (self.leg + 1))
            goal = min(self.steps + training.leg, training.steps)
            while self.steps < goal and not late:
                self._improve()
                late = deadline is not None and time.monotonic() > deadline
                if training.backend != "linear" and time.monotonic() > kept + SAVE_EVERY:
                    self.leg += 1  # whoever goes on from here draws other episodes
                    self._save()
                    kept = time.monotonic()
            self.curve.add(self.steps, [])
            self.leg += 1
            self._save()
        passed, done = time.monotonic() - began, self.steps - first
        rates = {f"{name}_seconds": seconds for name, seconds in self._seconds.items()}
        found = {"steps": self.steps, "legs": self.leg, "policy": str(self.folder), "time_up": late}
        rates |= {"steps_per_second": done / passed, "best_reached_less_torn": self._best}
        return found | rates | self._priced() | self.curve.last()

    def _begin(self, seed: int) -> None:
        """New episodes in all worlds, and where what they come to is found."""
        training, task = self.training, self.task
        task.bears = perforation_force(training, self.steps)
        task.reset(seeds=list(range(seed, seed + task.worlds)))
        if training.stagger:
            task.stagger(seed)

        def take(part: Any) -> Tensor:
            return torch.as_tensor(part, device=training.device)

        own = task.in_place
        self._action = take(own.action)
        self._observed, self._known = (
            [take(own.observation[name]) for name in names] for names in (self._own, self._beside)
        )
        self._recall = Recall(torch, training.recalls, task.interval)
        begins = torch.ones(task.worlds, dtype=torch.bool, device=training.device)
        self._shown = self._looked(self._action * 0.0, begins)
        self._told = {name: take(part)[:, 0] for name, part in own.told.items()}
        self._over = np.zeros(task.worlds, bool)
        self._before, nothing = self._harm(), torch.zeros(task.worlds, 1 + len(self._limits), device=training.device)
        self._sum, self._return = nothing.clone(), nothing[:, 0].clone()

    def _improve(self) -> None:
        """Drive for a rollout, and learn from it."""
        training, learner, began = self.training, self.learner, time.monotonic()
        known = learner.count > 0
        rollout, returns, ended = self._drive()
        driven = time.monotonic()
        seen = rollout.seen.flatten(0, 1)
        learner.take_in(seen, returns.flatten(0, 1), keep=bool(known) or self._knows)
        self._rollouts += 1
        said = "looking around"
        if known or self._knows:
            hold = self._knows and self._rollouts <= _HELD
            found = learner.learn(rollout, rate=learning_rate(training, self.steps), hold=hold)
            said = f"value loss {found['value_loss']:.3f}, divergence {found['kl']:.3f}"
        noted = self.curve.episode
        if len(ended) and self._limits:
            costs = [float(ended[:, noted.index(name)].mean()) / limit - 1 for name, limit in self._limits.items()]
            arrive = float(ended[:, noted.index("reached")].mean()) >= training.least_reached
            learner.reprice(torch.tensor(costs, device=training.device), arrive=arrive)
        self.steps += rollout.action[..., 0].numel()
        if len(ended) and (row := self.curve.add(self.steps, ended.tolist())):
            self._keep_best(row["reached"] * row.get("coverage", 1.0) - row["p_perforation"])
        self.task.bears = perforation_force(training, self.steps)
        self._progress(self.steps, said)
        self._seconds["environment"] += driven - began
        self._seconds["learning"] += time.monotonic() - driven

    def _drive(self) -> tuple[Rollout, Tensor, np.ndarray]:
        """A rollout; discounted sums of what was paid; and episodes that ended, as rows of the curve."""
        training, task, told = self.training, self.task, self._told
        count, worlds, kinds = training.rollout, task.worlds, 1 + len(self._limits)
        room: dict[str, Any] = {"device": training.device}
        seen = torch.empty(count + 1, worlds, self._width, **room)
        action = torch.empty(count, worlds, self._action.shape[1], **room)
        chance, paid = torch.empty(count, worlds, **room), torch.empty(count, worlds, kinds, **room)
        returns = torch.empty_like(paid)
        terminated, over, begins = (torch.empty(count, worlds, dtype=torch.bool, **room) for _ in range(3))
        ended = []
        seen[0] = self._shown
        with torch.no_grad():
            for step in range(count):
                begins[step] = torch.as_tensor(self._over, **room)
                action[step], chance[step] = self.learner.draw(seen[step])
                self._action.copy_(action[step])
                self._over = task.advance(self._over)
                seen[step + 1] = self._looked(action[step], begins[step])
                terminated[step] = told["terminated"] > 0
                over[step] = terminated[step] | (told["truncated"] > 0)
                harm = self._harm()
                paid[step, :, 0] = told["reward"]
                paid[step, :, 1:] = (harm - self._before) * ~begins[step, :, None]
                self._before = harm
                self._return = self._return * ~begins[step] + told["reward"]
                self._sum = self._sum * ~begins[step, :, None] * training.gamma + paid[step]
                returns[step] = self._sum
                if self._over.any():
                    ended.append(self._rows(over[step]))
        self._shown = seen[count].clone()
        rows = torch.cat(ended).cpu().numpy() if ended else np.zeros((0, len(self.curve.episode)))
        return Rollout(seen, action, chance, paid, terminated, over, begins), returns, rows

    def _looked(self, action: Tensor, begins: Tensor) -> Tensor:
        """What worlds show now and the policy recalls, what only the critic reads last."""
        own = self._recall.look(torch.cat(self._observed, dim=1), action, begins[:, None].float())
        return torch.cat([own, *self._known], dim=1)

    def _harm(self) -> Tensor:
        """What each limit counts of the running episodes so far."""
        worst = {"p_perforation": self._torn(), "pain": self._told["pain"].clone()}
        rows = [worst[name] for name in self._limits]
        return torch.stack(rows, dim=1) if rows else torch.zeros(self.task.worlds, 0, device=self.training.device)

    def _torn(self) -> Tensor:
        return perforation_probability(self._told["load"], log=torch.log, share_below=torch.special.ndtr)

    def _rows(self, over: Tensor) -> Tensor:
        """Episodes that are over, as its curve notes them."""
        named = {"return": self._return, "seconds": self._told["age"] * self.task.interval}
        named |= {"p_perforation": self._torn()}
        return torch.stack([(named | self._told | named)[name][over] for name in self.curve.episode], dim=1)

    def _priced(self) -> dict[str, float]:
        return {f"price_{name}": float(price) for name, price in zip(self._limits, self.learner.prices, strict=True)}

    def _save(self) -> None:
        """Write a checkpoint from which the next leg can begin, and the policy as it is now."""
        tensors = learned("learner", self.learner, self.learner.optimiser)
        document = {"steps_done": self.steps, "leg": self.leg, "training": self.training.to_json()}
        plain = {"rollouts": self._rollouts, "best": self._best}
        save_checkpoint(self.folder, tensors, document | {"plain": plain})
        self._save_policy(self.folder)

    def _keep_best(self, merit: float) -> None:
        if merit > self._best:
            self._best = merit
            self._save_policy(self.folder / BEST)

    def _save_policy(self, folder: Path) -> None:
        save_policy(folder, self.learner.policy(self.training, made_by(self.training, self.steps)))

    def _put_back(self, tensors: dict[str, Tensor], document: dict[str, Any]) -> None:
        put_back(tensors, "learner", self.learner, self.learner.optimiser)
        self.steps, self.leg = int(document["steps_done"]), int(document["leg"])
        self._rollouts, self._best = int(document["plain"]["rollouts"]), float(document["plain"]["best"])


def _fitting(training: Training) -> MlpPolicy:
    """The policy to begin as.

    Raises:
        InvalidOptionError: when it sees other than the task shows, or has other layers.
    """
    policy = load_policy(policy_folder(str(training.start)))
    layers = tuple(len(bias) for bias in policy.biases[:-1])
    if policy.activation != "tanh" or policy.squashed or layers != training.layers:
        raise InvalidOptionError(f"'{training.start}' has layers {layers}: set the same, of a policy that PPO trained.")
    if sizes(policy.config) != sizes(training.task) or policy.recalls != training.recalls:
        raise InvalidOptionError(
            f"'{training.start}' sees {sizes(policy.config)} and recalls {policy.recalls}: set the same."
        )
    return policy
