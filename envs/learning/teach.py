"""Learning on the device from who inspects: the pupil drives, the teacher says what it would have done (DAgger).

As `haustra.envs.learning.imitate`, but with thousands of worlds, on the GPU, and for networks that PPO goes on with:
their scales follow what is seen and paid meanwhile.
"""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from haustra.envs.learning.ppo import Ppo
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.inspect_driver import InspectDriver
from haustra.envs.tasks.scope_task import ScopeTask

_ROUNDS = 10
"""Times that the policy is fitted to all it has seen."""
_EVERY = 4
"""One control step of so many is remembered: those between are alike."""
_PASSES, _LAST = 4, 30
"""Passes over all that is remembered in each round, and in the last."""
_BATCH = 8192
"""Most samples in one step of the optimiser."""
_RATE = 1e-3
"""Learning rate of Adam [1]."""


def teach(
    learner: Ppo,
    training: Training,
    task: ScopeTask,
    teacher: InspectDriver,
    *,
    shown: Sequence[Sequence[str]],
    limits: Sequence[str],
    progress: Callable[[int, str], None],
) -> float:
    """Fit the actor to a teacher's actions in what it comes to itself.

    Args:
        learner: with the networks.
        training: its rates, and how many steps (`imitate`).
        task: worlds to drive in; reset by this.
        teacher: of these worlds.
        shown: names of the parts that the policy reads, and of those that only the critic does.
        limits: what else than the reward has a scale, by its name in `Step.info`.
        progress: told steps done, and a note.

    Returns:
        The last mean squared error of an action.
    """
    seed, device, worlds = training.seed, training.device, task.worlds
    random, optimiser = np.random.default_rng(seed), torch.optim.Adam(learner.actor.parameters(), lr=_RATE)
    seen = task.reset(seeds=list(range(seed, seed + worlds)))
    teacher.begin(np.ones(worlds, bool))
    begins, before = np.zeros(worlds, bool), _harm(task.info(), limits)
    total, pupil = np.zeros((worlds, 1 + len(limits))), np.zeros(worlds, bool)
    views: list[Tensor] = []
    answers: list[Tensor] = []
    count, error = max(_ROUNDS, training.imitate // worlds), float("nan")
    for step in range(count):
        turn, ends = step * _ROUNDS // count, (step + 1) * _ROUNDS // count > step * _ROUNDS // count
        asked = np.clip(teacher.act(seen), -1.0, 1.0).astype(np.float32)
        view = torch.as_tensor(np.concatenate([seen[name] for names in shown for name in names], axis=1), device=device)
        if step % _EVERY == 0:
            learner.take_in(view, torch.as_tensor(total, dtype=torch.float32, device=device), keep=turn > 0)
            views.append(view[:, : learner.seen])
            answers.append(torch.as_tensor(asked, device=device))
        with torch.no_grad():
            tried = learner.draw(view)[0].cpu().numpy()
        done = task.step(np.where(pupil[:, None], tried, asked), begins if begins.any() else None)
        harm = _harm(done.info, limits)
        paid = np.column_stack([done.reward, (harm - before) * ~begins[:, None]])
        total, before = total * training.gamma * ~begins[:, None] + paid, harm
        if begins.any():
            teacher.begin(begins)
        pupil = np.where(begins, random.random(worlds) < 1.0 - 0.5**turn, pupil)
        seen, begins = done.observation, done.terminated | done.truncated
        if ends:
            passes = _LAST if step == count - 1 else _PASSES
            error = _fit(learner, optimiser, torch.cat(views), torch.cat(answers), passes, min(_BATCH, training.batch))
            pupil = random.random(worlds) < 1.0 - 0.5 ** (turn + 1)
            progress(0, f"taught by {(step + 1) * worlds} steps, error {error:.4f}")
    return error


def _harm(info: dict[str, np.ndarray], limits: Sequence[str]) -> np.ndarray:
    """What each limit counts of the running episodes so far."""
    return np.stack([info[name] for name in limits], axis=1) if limits else np.zeros((len(info["time"]), 0))


def _fit(
    learner: Ppo, optimiser: torch.optim.Optimizer, views: Tensor, answers: Tensor, passes: int, batch: int
) -> float:
    """Passes over all that is remembered, in random batches; the last batch's mean squared error."""
    loss = torch.tensor(float("nan"))
    for _ in range(passes):
        for rows in torch.randperm(len(views), device=views.device).split(batch):
            loss = torch.nn.functional.mse_loss(learner.mean(views[rows]), answers[rows])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    return float(loss.detach())
