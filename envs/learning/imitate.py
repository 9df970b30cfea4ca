"""Learning from the lumen follower: the policy drives, the follower says what it would have done (DAgger).

Ross 2011, "A reduction of imitation learning and structured prediction to no-regret online learning". The follower
knows the centreline and all wall forces; the policy sees what a device could see, and learns to do as well with that.
Other devices than scopes are taught by the driver that each brings.
"""

from collections.abc import Callable

import numpy as np
import torch

from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.drivers import FollowerDriver, OwnDriver
from haustra.envs.tasks.scope_task import ScopeTask

_ROUNDS = 8
"""Times that the policy is fitted to all it has seen."""
_EPOCHS = 12
_BATCH = 512


def imitate(
    mean_action: Callable[[torch.Tensor], torch.Tensor],
    parameters: list[torch.nn.Parameter],
    task: ScopeTask | DeviceTask,
    *,
    steps: int,
    seed: int,
    learning_rate: float = 1e-3,
    progress: Callable[[int, float], None] = lambda done, loss: None,
    late: Callable[[], bool] = lambda: False,
) -> float:
    """Fit a policy to its teacher's actions on the states that the policy itself comes to.

    Args:
        mean_action: the policy: flat observations to actions.
        parameters: what may change.
        task: worlds to drive in; reset by this.
        steps: environment steps over all worlds.
        seed: of episodes and batches.
        learning_rate: of Adam.
        progress: told steps done and the last loss.
        late: whether to be done with what there is.

    Returns:
        The last mean squared error of an action.
    """
    optimiser = torch.optim.Adam(parameters, lr=learning_rate)
    random = np.random.default_rng(seed)
    seen = task.reset(seeds=[seed + world for world in range(task.worlds)])
    teacher = OwnDriver(task) if isinstance(task, DeviceTask) else FollowerDriver(task)
    teacher.begin(np.ones(task.worlds, bool))
    views: list[np.ndarray] = []
    answers: list[np.ndarray] = []
    per_round, loss = max(1, steps // (_ROUNDS * task.worlds)), float("nan")
    for turn in range(_ROUNDS):
        own = 1.0 - 0.5**turn  # share of worlds in which the policy drives; none at first
        pupil = random.random(task.worlds) < own
        for _ in range(per_round):
            asked, view = teacher.act(seen), seen_by.flat(seen)
            views.append(view)
            answers.append(asked.astype(np.float32))
            with torch.no_grad():
                tried = mean_action(torch.as_tensor(view)).numpy()
            done = task.step(np.where(pupil[:, None], tried, asked))
            seen, over = done.observation, done.terminated | done.truncated
            if over.any():
                seen = task.reset(np.flatnonzero(over))
                teacher.begin(over)
                pupil = np.where(over, random.random(task.worlds) < own, pupil)
            progress(len(views) * task.worlds, loss)
            if late():
                break
        loss = fit(mean_action, optimiser, np.concatenate(views), np.concatenate(answers), random)
        if late():
            break
    return loss


def fit(
    mean_action: Callable[[torch.Tensor], torch.Tensor],
    optimiser: torch.optim.Optimizer,
    views: np.ndarray,
    answers: np.ndarray,
    random: np.random.Generator,
) -> float:
    """Fit a policy to answers by some passes in random batches; the last batch's mean squared error."""
    seen, wanted = torch.as_tensor(views), torch.as_tensor(answers)
    loss = torch.tensor(float("nan"))
    for _ in range(_EPOCHS):
        order = torch.as_tensor(random.permutation(len(views)))
        for rows in order.split(_BATCH):
            loss = torch.nn.functional.mse_loss(mean_action(seen[rows]), wanted[rows])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    return float(loss.detach())
