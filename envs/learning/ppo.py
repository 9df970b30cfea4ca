"""Proximal policy optimisation in torch, wherever its tensors are, with limits on what an episode may cost.

Schulman 2017 (arXiv:1707.06347) with generalised advantages (Schulman 2016, arXiv:1506.02438). Each limit has a price,
by which its cost is taken off the reward, and which rises while episodes cost more than the limit and falls while they
cost less: a Lagrange multiplier (Ray 2019, Benchmarking safe exploration in deep reinforcement learning).
"""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.learning.schedule import LEAST_DEVIATION
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.actions import ACTIONS, actions_of

_CLIP = 0.2
"""Most that the chance of an action may change in an update before it no longer counts [1]."""
_LARGEST_GRADIENT = 0.5
"""Norm to which gradients are cut [1]."""
_FIRST_SHARE = 0.01
"""Share of its usual weights that an untrained policy's last layer has [1]."""
_LEAST_PRICE = 1e-4
"""A price falls no lower, so that it can rise again [1]."""


class Rollout(NamedTuple):
    """What some steps of all worlds led to. An episode that is over begins anew in the step after it."""

    seen: Float[Tensor, "steps+1 worlds entries"]
    """Observations before each step, and after the last; entries that only the critic sees are the last."""
    action: Float[Tensor, "steps worlds actions"]
    chance: Float[Tensor, "steps worlds"]
    """Logarithm of the density with which each action was drawn."""
    paid: Float[Tensor, "steps worlds kinds"]
    """Reward, then what each limit counts."""
    terminated: Bool[Tensor, "steps worlds"]
    """Ended by what happened, not by the clock."""
    over: Bool[Tensor, "steps worlds"]
    began: Bool[Tensor, "steps worlds"]
    """Began anew instead of acting."""


class Ppo(nn.Module):
    """Actor and critic, the scales of what they read and of what is paid, and the prices of limits."""

    seen_mean: Tensor
    seen_var: Tensor
    paid_var: Tensor
    count: Tensor
    prices: Tensor

    def __init__(self, training: Training, *, seen: int, hidden: int = 0, limits: int = 0) -> None:
        """Untrained networks.

        Args:
            training: layers, rates and prices.
            seen: entries that a policy reads.
            hidden: further entries that only the critic reads.
            limits: how many costs are limited.
        """
        super().__init__()
        self._training, self.seen = training, seen
        actions = len(actions_of(training.task))
        self.actor = _layers(seen, training.layers, actions)
        self.critic = _layers(seen + hidden, training.layers, 1 + limits)
        self.log_std = nn.Parameter(torch.full((actions,), training.log_std))
        last = self.actor[-1]
        assert isinstance(last, nn.Linear)
        with torch.no_grad():
            last.weight.mul_(_FIRST_SHARE)
            last.bias[ACTIONS.index("push")] = training.first_push
        for name, value in (
            ("seen_mean", torch.zeros(seen + hidden)),
            ("seen_var", torch.full((seen + hidden,), 1.0 - LEAST_DEVIATION**2)),
            ("paid_var", torch.ones(1 + limits)),
            ("count", torch.zeros((), dtype=torch.float64)),
            ("prices", torch.full((limits,), training.prices[0])),
        ):
            self.register_buffer(name, value)
        self.optimiser = torch.optim.Adam(self.parameters(), lr=training.learning_rate, eps=1e-5)

    def begin_as(self, policy: MlpPolicy) -> None:
        """Act as a trained policy of the same layers does."""
        with torch.no_grad():
            for layer, weight, bias in zip(self._linear(self.actor), policy.weights, policy.biases, strict=True):
                layer.weight.copy_(torch.as_tensor(weight))
                layer.bias.copy_(torch.as_tensor(bias))
            if policy.deviation is not None:
                self.log_std.copy_(torch.as_tensor(policy.deviation).log())

    def scaled(self, seen: Tensor) -> Tensor:
        """Observations over their deviation."""
        return (seen - self.seen_mean) / self._deviation()

    def mean(self, seen: Float[Tensor, "worlds read"]) -> Tensor:
        """Mean actions for what the policy reads."""
        return self.actor((seen - self.seen_mean[: self.seen]) / self._deviation()[: self.seen])

    def draw(self, seen: Float[Tensor, "worlds entries"]) -> tuple[Tensor, Tensor]:
        """Actions, and the logarithm of the density with which they were drawn."""
        mean = self.actor(self.scaled(seen)[:, : self.seen])
        action = mean + self.log_std.exp() * torch.randn_like(mean)
        return action, self._chance(mean, action)

    def take_in(
        self, seen: Float[Tensor, "looks entries"], returns: Float[Tensor, "steps kinds"], *, keep: bool
    ) -> None:
        """Let scales follow what is seen and paid.

        Args:
            seen: observations.
            returns: discounted sums of what was paid so far.
            keep: whether the networks go on saying of every observation what they said before.
        """
        with torch.no_grad():
            mean, deviation, more = self.seen_mean.clone(), self._deviation(), float(len(seen))
            total = self.count + more
            away, share = seen.mean(0) - mean, more / total
            own = self.seen_var * (1 - share) if self.count > 0 else 0.0
            self.seen_var.copy_(own + seen.var(0, correction=0) * share + away**2 * share * (1 - share))
            self.seen_mean += away * share
            self.paid_var += (returns.var(0, correction=0) - self.paid_var) * share
            self.count.copy_(total)
            if keep:
                moved, ratio = (self.seen_mean - mean) / deviation, self._deviation() / deviation
                for first in (self._linear(self.actor)[0], self._linear(self.critic)[0]):
                    width = first.in_features
                    first.bias.add_(first.weight @ moved[:width])
                    first.weight.mul_(ratio[:width])

    def learn(self, rollout: Rollout, *, rate: float, hold: bool) -> dict[str, float]:
        """Improve both networks by a rollout.

        Args:
            rollout: what the actor as it is now led to.
            rate: of the optimiser.
            hold: whether only the critic learns.

        Returns:
            Mean loss of the critic, divergence from the old policy, and passes done.
        """
        training = self._training
        advantage, value = self._advantages(rollout)
        rows = (~rollout.began).flatten().nonzero()[:, 0]
        seen, action, chance, advantage, value = (
            part.flatten(0, 1) for part in (rollout.seen[:-1], rollout.action, rollout.chance, advantage, value)
        )
        kept = advantage[rows]
        advantage = (advantage - kept.mean()) / (kept.std(correction=0) + 1e-8)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        losses, divergence, passes = [], torch.zeros(()), 0
        actor, critic = [*self.actor.parameters(), self.log_std], list(self.critic.parameters())
        for _ in range(training.epochs):
            for some in rows[torch.randperm(len(rows), device=rows.device)].split(training.batch):
                read = self.scaled(seen[some])
                ratio = self._chance(self.actor(read[:, : self.seen]), action[some]) - chance[some]
                with torch.no_grad():
                    divergence = (ratio.exp() - 1 - ratio).mean()
                if losses and not hold and divergence > 1.5 * training.target_kl:
                    return {"value_loss": float(torch.stack(losses).mean()), "kl": float(divergence), "passes": passes}
                ratio = ratio.exp()
                gain = torch.minimum(
                    ratio * advantage[some], ratio.clamp(1 - _CLIP, 1 + _CLIP) * advantage[some]
                ).mean()
                missed = ((self.critic(read) - value[some]) ** 2).sum(1).mean()
                losses.append(missed.detach())
                loss = missed if hold else missed - gain - training.entropy * self.log_std.sum()
                self.optimiser.zero_grad()
                loss.backward()
                for part in (critic,) if hold else (critic, actor):
                    nn.utils.clip_grad_norm_(part, _LARGEST_GRADIENT)
                self.optimiser.step()
            passes += 1
        return {"value_loss": float(torch.stack(losses).mean()), "kl": float(divergence), "passes": passes}

    def reprice(self, excess: Float[Tensor, " limits"], *, arrive: bool) -> None:
        """Let prices follow what episodes cost.

        Args:
            excess: cost over limit, minus one, of the episodes that ended.
            arrive: whether enough of them reached the end for any price to rise; else all fall.
        """
        training, (_, most) = self._training, self._training.prices
        moves = excess.clamp(-1.0, 1.0 if arrive else -1.0)
        self.prices.mul_((training.price_rate * moves).exp()).clamp_(_LEAST_PRICE, most)

    def policy(self, training: Training, about: dict[str, Any]) -> MlpPolicy:
        """The actor as plain layers that read bare observations."""
        layers = self._linear(self.actor)
        weights = [layer.weight.detach().cpu().double().numpy() for layer in layers]
        biases = [layer.bias.detach().cpu().double().numpy() for layer in layers]
        mean, deviation = (part[: self.seen].cpu().double().numpy() for part in (self.seen_mean, self._deviation()))
        weights[0] = weights[0] / deviation
        biases[0] = biases[0] - weights[0] @ mean
        return MlpPolicy(
            weights=tuple(weight.astype(np.float32) for weight in weights),
            biases=tuple(bias.astype(np.float32) for bias in biases),
            activation="tanh",
            squashed=False,
            config=training.task_then,
            about=about,
            deviation=self.log_std.detach().exp().cpu().numpy(),
            recalls=training.recalls,
        )

    def _advantages(self, rollout: Rollout) -> tuple[Tensor, Tensor]:
        """Advantages of the actions, costs priced in, and what the critic should have said."""
        training, paid = self._training, rollout.paid / self.paid_var.sqrt().clamp(min=1e-6)
        with torch.no_grad():
            values = torch.stack([self.critic(self.scaled(seen)) for seen in rollout.seen])
            last, found = torch.zeros_like(paid[0]), torch.empty_like(paid)
            for step in reversed(range(len(paid))):
                ahead = values[step + 1] * ~rollout.terminated[step, :, None]
                error = paid[step] + training.gamma * ahead - values[step]
                last = error + training.gamma * training.trace * ~rollout.over[step, :, None] * last
                found[step] = last
            return found[..., 0] - found[..., 1:] @ self.prices, found + values[:-1]

    def _chance(self, mean: Tensor, action: Tensor) -> Tensor:
        away = (action - mean) / self.log_std.exp()
        return (-0.5 * away**2 - self.log_std - 0.5 * math.log(2 * math.pi)).sum(-1)

    def _deviation(self) -> Tensor:
        return (self.seen_var + LEAST_DEVIATION**2).sqrt()

    @staticmethod
    def _linear(network: nn.Sequential) -> list[nn.Linear]:
        return [part for part in network if isinstance(part, nn.Linear)]


def _layers(width: int, hidden: tuple[int, ...], out: int) -> nn.Sequential:
    """Layers with tanh between them, orthogonal at the start."""
    parts: list[nn.Module] = []
    for before, after in pairwise((width, *hidden, out)):
        layer = nn.Linear(before, after)
        nn.init.orthogonal_(layer.weight, math.sqrt(2) if after != out else 1.0)
        nn.init.zeros_(layer.bias)
        parts += [layer, nn.Tanh()]
    return nn.Sequential(*parts[:-1])
