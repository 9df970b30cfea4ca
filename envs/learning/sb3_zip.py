"""Policies of Stable-Baselines3's own format. Loading one runs code that it contains."""

from pathlib import Path

from haustra.envs.learning.models import policy_of
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.learning.settings import Training
from haustra.errors import InvalidOptionError, UnreadableFileError


def load_zip(path: Path, training: Training, *, trust: bool) -> MlpPolicy:
    """Read a PPO or SAC model saved by Stable-Baselines3 and take its layers.

    Args:
        path: the file.
        training: which algorithm and task it is of.
        trust: the caller vouches for the file.

    Raises:
        InvalidOptionError: without `trust`.
        UnreadableFileError: when it cannot be read.
    """
    if not trust:
        raise InvalidOptionError(
            f"'{path}' is a Stable-Baselines3 file: loading it runs code that it contains. If you made it, say --trust."
        )
    from stable_baselines3 import PPO, SAC

    try:
        model = (PPO if training.algorithm == "ppo" else SAC).load(path, device="cpu")
    except Exception as error:
        raise UnreadableFileError(f"'{path}' is no {training.algorithm} model ({error}).") from error
    return policy_of(model, training, {"loaded_from": path.name})
