"""Policies by the names of drivers, and what is recorded of them."""

from pathlib import Path

from haustra.envs.control.laws import DRIVERS
from haustra.envs.learning.hands import PolicySettings
from haustra.envs.learning.policy import ABOUT, SHIPPED_POLICIES, WEIGHTS, MlpPolicy, load_any_policy, policy_folder
from haustra.errors import InvalidOptionError
from haustra.provenance import file_hash


def find_policy(name: str) -> MlpPolicy | None:
    """The policy that a driver's name stands for, of a scope or another device; None where a law drives.

    Raises:
        InvalidOptionError: when there is no such driver.
        UnreadableFileError: when the folder holds no policy.
    """
    if name in DRIVERS or name.endswith(".toml"):
        return None
    if name not in SHIPPED_POLICIES and not (Path(name) / ABOUT).is_file():
        known = ", ".join((*DRIVERS, *SHIPPED_POLICIES))
        raise InvalidOptionError(
            f"Driver '{name}' is not known. Known: {known}, a TOML file, or the folder of a policy."
        )
    return load_any_policy(policy_folder(name))


def policy_settings(name: str, policy: MlpPolicy, *, seed: int = 0) -> PolicySettings:
    """How a policy of that name drives: by actions drawn as in training, where it knows how far they vary."""
    return PolicySettings(
        policy=name,
        weights=file_hash(policy_folder(name) / WEIGHTS),
        advance_rate=policy.config.drive.push_rate,
        sampled=policy.deviation is not None,
        seed=seed,
    )
