"""Policy optimisation on problems whose answers are known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from haustra.envs.learning.ppo import Ppo, Rollout
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.config import TaskConfig

TRAINING = Training(
    learner="device",
    backend="linear",
    imitate=0,
    normalise=True,
    layers=(16,),
    batch=256,
    epochs=4,
    gamma=0.9,
    trace=0.8,
    log_std=-1.0,
    target_kl=0.1,
    prices=(0.1, 30.0),
    price_rate=0.3,
    task=TaskConfig(observation="state"),
)
SEEN = 18


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)


def rollout(paid: Any, *, over: Any = (), terminated: Any = (), began: Any = (), seen: Any = None) -> Rollout:
    """One world; times at which something is so."""
    steps = len(paid)
    at = {name: torch.zeros(steps, 1, dtype=torch.bool) for name in ("terminated", "over", "began")}
    for name, times in (("terminated", terminated), ("over", over), ("began", began)):
        at[name][list(times)] = True
    seen = torch.zeros(steps + 1, 1, SEEN) if seen is None else seen
    return Rollout(
        seen, torch.zeros(steps, 1, 4), torch.zeros(steps, 1), torch.as_tensor(paid).reshape(steps, 1, -1), **at
    )


def _always(learner: Ppo, value: float) -> None:
    """A critic that says this of everything."""
    last: Any = learner.critic[-1]
    last.weight.zero_()
    last.bias.fill_(value)


def test_advantages_end_where_episodes_do():
    """By hand: a critic that always says 2; an episode that ends by itself, and one that the clock cuts."""
    learner = Ppo(TRAINING, seen=SEEN)
    with torch.no_grad():
        _always(learner, 2.0)
    found, value = learner._advantages(
        rollout([1.0, 1.0, 0.0, 1.0, 0.0, 1.0], over=(1, 3), terminated=(1,), began=(2, 4))
    )
    ends, cut, last = 1.0 - 2.0, 1.0 + 0.9 * 2.0 - 2.0, 1.0 + 0.9 * 2.0 - 2.0
    first = 1.0 + 0.9 * 2.0 - 2.0 + 0.9 * 0.8 * ends
    assert found[[0, 1, 3, 5], 0].tolist() == pytest.approx([first, ends, cut, last])
    assert value[[1, 5], 0, 0].tolist() == pytest.approx([ends + 2.0, last + 2.0])


def test_a_price_is_taken_off_and_what_is_paid_is_scaled():
    learner = Ppo(TRAINING, seen=SEEN, limits=1)
    with torch.no_grad():
        _always(learner, 0.0)
        learner.prices.fill_(0.5)
        learner.paid_var.copy_(torch.tensor([4.0, 0.25]))
    found, _ = learner._advantages(rollout([[1.0, 3.0]], over=(0,), terminated=(0,)))
    assert float(found) == pytest.approx(1.0 / 2.0 - 0.5 * 3.0 / 0.5)


def test_networks_say_the_same_when_scales_follow_what_is_seen():
    torch.manual_seed(0)
    learner = Ppo(replace(TRAINING, first_push=0.3), seen=SEEN, hidden=2)
    seen = 3.0 + 5.0 * torch.rand(512, SEEN + 2)
    for scale in (1.0, 0.1):
        before = learner.critic(learner.scaled(seen)).detach()
        acted = learner.actor(learner.scaled(seen)[:, :SEEN]).detach()
        learner.take_in(seen * scale, torch.rand(512, 1), keep=True)
        assert learner.critic(learner.scaled(seen)).detach().numpy() == pytest.approx(before.numpy(), abs=1e-4)
    bare = seen[:, :SEEN].numpy()
    assert learner.policy(TRAINING, {}).act(bare) == pytest.approx(np.clip(acted.numpy(), -1, 1), abs=1e-4)
    assert learner.seen_mean.numpy() == pytest.approx(torch.cat([seen, 0.1 * seen]).mean(0).numpy(), rel=1e-4)


@pytest.mark.parametrize("limited", [False, True])
def test_a_policy_finds_what_pays_best_within_a_limit(limited):
    """Pay is -(a - 0.6)^2 in each of four actions; the first may not come to more than 0.2 on average."""
    torch.manual_seed(1)
    learner = Ppo(TRAINING, seen=SEEN, limits=int(limited))
    for _ in range(40):
        seen = torch.randn(2, 512, SEEN)
        with torch.no_grad():
            action, chance = learner.draw(seen[0])
        paid = -((action - 0.6) ** 2).sum(1, keepdim=True)
        paid = torch.cat([paid, action[:, :1]], dim=1) if limited else paid
        over = torch.ones(1, 512, dtype=torch.bool)
        learner.take_in(seen[0], paid, keep=True)
        learner.learn(Rollout(seen, action[None], chance[None], paid[None], over, over, ~over), rate=0.01, hold=False)
        if limited:
            learner.reprice(action[:, :1].mean(0) / 0.2 - 1, arrive=True)
    mean = learner.actor(learner.scaled(torch.zeros(1, SEEN))).detach()[0]
    assert mean[1:].tolist() == pytest.approx([0.6] * 3, abs=0.15)
    assert float(mean[0]) == pytest.approx(0.2 if limited else 0.6, abs=0.15)


def test_prices_rise_only_while_enough_arrive():
    learner = Ppo(TRAINING, seen=SEEN, limits=2)
    learner.reprice(torch.tensor([9.0, -0.5]), arrive=True)
    assert learner.prices.tolist() == pytest.approx([0.1 * np.exp(0.3), 0.1 * np.exp(-0.15)])
    learner.reprice(torch.tensor([9.0, -0.5]), arrive=False)
    assert learner.prices.tolist() == pytest.approx([0.1, 0.1 * np.exp(-0.45)])
