"""Learning from recordings of episodes: whoever drove, hand, driver or policy, is imitated before rewards are."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float

from haustra.envs.console.recording import ABOUT, load_recording
from haustra.envs.learning.imitate import fit
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.observation import sizes
from haustra.errors import InvalidOptionError, UnreadableFileError

_PASSES = 40
"""Times that the policy is fitted to a dozen passes over all that was demonstrated, until it no longer gains."""
_GAIN = 0.01
"""Share of the error that each of these must gain [1]."""


class Demonstrations(NamedTuple):
    """What was seen, and what was done then."""

    seen: Float[np.ndarray, "steps observations"]
    done: Float[np.ndarray, "steps actions"]
    episodes: int
    """How many recordings they are from."""


def load_demonstrations(folder: Path, task: TaskConfig) -> Demonstrations:
    """Recordings of a folder, or of the folders in it.

    Raises:
        UnreadableFileError: when it holds none.
        InvalidOptionError: when one is no episode, or shows other than the task does.
    """
    inner = sorted(path.parent for path in folder.glob(f"*/{ABOUT}"))
    paths = [folder] if (folder / ABOUT).is_file() else inner
    if not paths:
        raise UnreadableFileError(f"'{folder}' holds no recordings: make some with `haustra record --task`.")
    width = sum(int(np.prod(shape)) for shape in sizes(task).values())
    seen, done = [], []
    for path in paths:
        rows = load_recording(path).rows
        if "observation" not in rows:
            raise InvalidOptionError(f"'{path}' is no episode of a task: record it with --task.")
        if rows["observation"].shape[1] != width:
            raise InvalidOptionError(
                f"'{path}' shows {rows['observation'].shape[1]} numbers, the task {width}: record it with --task of a "
                "policy that sees as much."
            )
        # A row holds what was done and what came of it: what was seen before is in the row before.
        seen.append(rows["observation"][:-1])
        done.append(rows["levers"][1:])
    return Demonstrations(np.concatenate(seen).astype(np.float32), np.concatenate(done).astype(np.float32), len(paths))


def clone(
    mean_action: Callable[[torch.Tensor], torch.Tensor],
    parameters: list[torch.nn.Parameter],
    shown: Demonstrations,
    *,
    seed: int,
    learning_rate: float = 1e-3,
    progress: Callable[[int, float], None] = lambda done, loss: None,
) -> float:
    """Fit a policy to demonstrations.

    Args:
        mean_action: the policy: flat observations to actions.
        parameters: what may change.
        shown: the demonstrations.
        seed: of batches.
        learning_rate: of Adam.
        progress: told passes done and the last loss.

    Returns:
        The last mean squared error of an action.
    """
    optimiser, random = torch.optim.Adam(parameters, lr=learning_rate), np.random.default_rng(seed)
    loss = float("inf")
    for count in range(_PASSES):
        before, loss = loss, fit(mean_action, optimiser, shown.seen, shown.done, random)
        progress(count + 1, loss)
        if loss > before * (1 - _GAIN):
            break
    return loss
