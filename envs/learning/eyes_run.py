"""Training of eyes: a policy that sees depth drives by what its eyes make of colour, and these learn what was there.

Worlds are driven by the pupil itself, so that eyes learn from the pictures that it comes to (DAgger, Ross 2011); while
the eyes know nothing, a share of the worlds is driven by what rays say. Light, colour and noise of pictures vary.
"""

import csv
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from haustra.envs.learning.checkpoint import learned, put_back, restore, save_checkpoint
from haustra.envs.learning.curve import begin_rows
from haustra.envs.learning.eyes import COLOURS, RAYS, STRIDE, Eyes
from haustra.envs.learning.policy import MlpPolicy, load_policy, policy_folder, save_policy
from haustra.envs.learning.recall import Recall
from haustra.envs.learning.schedule import SAVE_EVERY, learning_rate, made_by
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.observation import depth_weight
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.sight import ray_directions
from haustra.errors import InvalidOptionError
from haustra.files import write_json

CHANNELS, KERNELS, HIDDEN = (16, 32, 64, 64), (5, 3, 3, 3), 128
"""Outputs and breadth of the convolutions, and width of the hidden layer."""
_LOOKS = 24
"""Looks of all worlds that are remembered: some three seconds."""
_LED = 0.25
"""Share of the steps by the end of which no world is driven by rays any more."""
_GAIN, _TINT, _GAMMA, _NOISE = 0.25, 0.1, 0.25, 0.02
"""Pictures' brightness, colours and gamma are varied by as large shares, and each channel by noise; engineering choice:
beyond what one lens and one processor do to pictures."""
COLUMNS = ("steps", "error", "led", "episodes", "reached", "seconds")
"""Columns of the curve; the error is the root mean square of the rays' distances over the range."""


class EyesRun:
    """Networks that see, a policy that drives by them, and worlds that show pictures without a copy."""

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
            InvalidOptionError: when the policy that drives is none that eyes can be given to.
        """
        self.training, self.folder, self.task, self._progress = training, folder, task, progress
        self._hand = load_policy(policy_folder(str(training.start)))
        require_hand(self._hand, training)
        torch.manual_seed(training.seed)
        self.network = _network(training.task.picture_size).to(training.device)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=training.learning_rate)
        self.steps, self.leg = 0, 0
        if document is None:
            write_json(folder / "training.json", training.to_json())
        else:
            restore(folder, document, lambda tensors, _: self._put_back(tensors, document))
        begin_rows(folder / "curve.csv", COLUMNS, steps=self.steps)
        room: dict[str, Any] = {"device": training.device}
        layers = zip(self._hand.weights, self._hand.biases, strict=True)
        self._layers = [(torch.as_tensor(weight, **room), torch.as_tensor(bias, **room)) for weight, bias in layers]
        self._rays = torch.as_tensor(ray_directions()[:, :2], dtype=torch.float32, **room)
        self._ended: list[tuple[float, float]] = []
        self._errors: list[Tensor] = []
        self._last: dict[str, float] = {}

    def go(self, deadline: float | None) -> dict[str, Any]:
        """Learn until the steps are done or time is up."""
        training, late, first = self.training, False, self.steps
        began = kept = time.monotonic()
        self._begin(training.seed + 1_000_000 * (self.leg + 1))
        while self.steps < training.steps and not late:
            self._step()
            late = deadline is not None and time.monotonic() > deadline
            if time.monotonic() > kept + SAVE_EVERY:
                self._save()
                kept = time.monotonic()
        if self._errors:
            self._row()
        self._save()
        rate = (self.steps - first) / (time.monotonic() - began)
        found = {"steps": self.steps, "policy": str(self.folder), "time_up": late, "steps_per_second": rate}
        return found | {f"last_{name}": value for name, value in self._last.items()}

    def _begin(self, seed: int) -> None:
        training, task = self.training, self.task
        torch.manual_seed(seed)
        self._random = np.random.default_rng(seed)
        task.reset(seeds=list(range(seed, seed + task.worlds)))
        task.draw()
        if training.stagger:
            task.stagger(seed)

        def take(part: Any) -> Tensor:
            return torch.as_tensor(part, device=training.device)

        own = task.in_place
        self._action, self._pixels = take(own.action), take(own.observation["pixels"])
        self._lumen = take(own.observation["lumen"])
        self._told = {name: take(own.told[name])[:, 0] for name in ("reached", "age")}
        self._recall = Recall(torch, self._hand.recalls, task.interval)
        self._over, self._begins = np.zeros(task.worlds, bool), torch.ones(task.worlds, 1, device=training.device)
        self._led = torch.rand(task.worlds, device=training.device) < self._share_led()
        self._pictures: list[Tensor] = []
        self._distances: list[Tensor] = []

    def _share_led(self) -> float:
        """Share of the worlds that are driven by what rays say."""
        return max(0.0, 1.0 - self.steps / (_LED * self.training.steps))

    def _step(self) -> None:
        """Look, drive, remember, and learn."""
        task, training = self.task, self.training
        picture = self._pixels[..., :COLOURS].clone()
        near = self._lumen[:, :RAYS].clone()
        self._pictures = [*self._pictures, picture][-_LOOKS:]
        self._distances = [*self._distances, near][-_LOOKS:]
        with torch.no_grad():
            told = self.network(_scaled(picture))
            self._errors.append(((told - near) ** 2).mean())
            shown = torch.where(self._led[:, None], self._lumen, self._as_lumen(told))
            self._act(shown)
        begins = self._over
        self._over = task.advance(begins)
        self._begins = torch.as_tensor(begins, device=training.device).float()[:, None]
        renewed = torch.rand(task.worlds, device=training.device) < self._share_led()
        self._led = torch.where(self._begins[:, 0] > 0, renewed, self._led & (self._share_led() > 0))
        if self._over.any():
            ended = torch.as_tensor(self._over, device=training.device)
            rows = torch.stack([self._told["reached"][ended], self._told["age"][ended] * task.interval], dim=1)
            self._ended += [tuple(row) for row in rows.tolist()]
        for _ in range(training.epochs):
            self._learn()
        self.steps += task.worlds
        if len(self._errors) >= training.rollout:
            row = self._row()
            self._progress(self.steps, f"error {row['error']:.4f}, {row['reached']:.3f} reach the end")

    def _act(self, shown: Tensor) -> None:
        """Ask for what the policy asks for, as freely as it did in training."""
        value = self._recall.look(shown, self._action, self._begins)
        for weight, bias in self._layers[:-1]:
            value = torch.tanh(value @ weight.T + bias)
        weight, bias = self._layers[-1]
        mean = value @ weight.T + bias
        spread = 0.0 if self._hand.deviation is None else torch.as_tensor(self._hand.deviation, device=mean.device)
        self._action.copy_((mean + spread * torch.randn_like(mean)).clamp(-1.0, 1.0))

    def _learn(self) -> None:
        """One step of the optimiser on looks of any age."""
        training, batch = self.training, self.training.batch
        look = self._random.integers(len(self._pictures), size=8)
        rows = torch.randint(self.task.worlds, (batch // 8,), device=training.device)
        pictures = torch.cat([self._pictures[at][rows] for at in look])
        wanted = torch.cat([self._distances[at][rows] for at in look])
        loss = nn.functional.mse_loss(self.network(_varied(_scaled(pictures))), wanted)
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate(training, self.steps)
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()

    def _as_lumen(self, near: Tensor) -> Tensor:
        """What `haustra.envs.tasks.observation.lumen` says of those distances."""
        weight = depth_weight(near)
        return torch.cat([near, (weight @ self._rays) / weight.sum(dim=1, keepdim=True)], dim=1)

    def _row(self) -> dict[str, float]:
        """Write a row of the curve, and begin the next."""
        ended = np.array(self._ended or [(np.nan, np.nan)])
        error = float(torch.stack(self._errors).mean().sqrt())
        values = self.steps, error, self._share_led(), len(self._ended), *ended.mean(axis=0).tolist()
        row = dict[str, float](zip(COLUMNS, values, strict=True))
        with (self.folder / "curve.csv").open("a", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow([f"{value:.5g}" if isinstance(value, float) else value for value in row.values()])
        self._ended, self._errors, self._last = [], [], row
        return row

    def _save(self) -> None:
        self.leg += 1  # whoever goes on from here draws other episodes
        document = {"steps_done": self.steps, "leg": self.leg, "training": self.training.to_json(), "plain": {}}
        save_checkpoint(self.folder, learned("network", self.network, self.optimiser), document)
        save_policy(self.folder, self._policy())

    def _policy(self) -> MlpPolicy:
        """The policy that drives, with these eyes."""
        held = [value.detach().cpu().numpy() for value in self.network.state_dict().values()]
        weights, biases = held[0::2], held[1::2]
        eyes = Eyes(tuple(weights[:-2]), tuple(biases[:-2]), (weights[-2], weights[-1]), (biases[-2], biases[-1]))
        hand = self._hand
        return MlpPolicy(
            weights=hand.weights,
            biases=hand.biases,
            activation=hand.activation,
            squashed=hand.squashed,
            config=self.training.task_then,
            about=made_by(self.training, self.steps) | {"hand": hand.about},
            deviation=hand.deviation,
            recalls=hand.recalls,
            eyes=eyes,
        )

    def _put_back(self, tensors: dict[str, Tensor], document: dict[str, Any]) -> None:
        put_back(tensors, "network", self.network, self.optimiser)
        self.steps, self.leg = int(document["steps_done"]), int(document["leg"])


def require_hand(hand: MlpPolicy, training: Training) -> None:
    """Refuse a policy that eyes cannot be given to.

    Raises:
        InvalidOptionError: when it does not see the lumen alone, no PPO trained it, or its hand is another.
    """
    if hand.config.observation != "lumen" or hand.eyes is not None:
        raise InvalidOptionError(f"'{training.start}' does not drive by the lumen alone: start from one that does.")
    if hand.activation != "tanh" or hand.squashed:
        raise InvalidOptionError(f"'{training.start}' was not trained by PPO: start from a policy that was.")
    if hand.config.drive != training.task.drive:
        raise InvalidOptionError(f"'{training.start}' has another hand (drive) than the task: set the same.")


def _network(size: int) -> nn.Sequential:
    """Layers as `Eyes` has them, for pictures of so many rows and columns."""
    parts: list[nn.Module] = []
    before, width = COLOURS, size
    for after, kernel in zip(CHANNELS, KERNELS, strict=True):
        parts += [nn.Conv2d(before, after, kernel, stride=STRIDE, padding=kernel // 2), nn.ReLU()]
        before, width = after, (width - 1) // STRIDE + 1
    parts += [nn.Flatten(), nn.Linear(before * width**2, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, RAYS), nn.Sigmoid()]
    return nn.Sequential(*parts)


def _scaled(pictures: Tensor) -> Tensor:
    """Bytes with colours last as numbers from 0 to 1 with colours first."""
    return pictures.permute(0, 3, 1, 2).float() / 255.0


def _varied(pictures: Tensor) -> Tensor:
    """Pictures as they would be in other light, through another processor."""
    count = len(pictures)

    def around_one(*shape: int, by: float) -> Tensor:
        return 1.0 + by * (2.0 * torch.rand(shape, device=pictures.device) - 1.0)

    gain = around_one(count, 1, 1, 1, by=_GAIN) * around_one(count, COLOURS, 1, 1, by=_TINT)
    bent = pictures.clamp(min=1e-3) ** around_one(count, 1, 1, 1, by=_GAMMA)
    return (gain * bent + _NOISE * torch.randn_like(pictures)).clamp(0.0, 1.0)
