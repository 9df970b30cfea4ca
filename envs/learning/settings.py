"""How a policy is trained: the algorithm's numbers and the task, as one JSON value; the shipped configurations."""

import json
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from haustra.assets import asset
from haustra.envs.sim.device_backends import DEVICE_BACKENDS
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.observation import IN_BYTES, sizes
from haustra.errors import InvalidOptionError

ALGORITHMS = ("ppo", "sac")
BACKENDS = ("native", "linear", *DEVICE_BACKENDS)
DEVICES = ("cpu", "cuda")
SHIPPED = ("insertion-ppo", "insertion-gpu", "insertion-mesentery", "insertion-easy", "insertion-sac", "quick")
"""Configurations in assets/training."""


@dataclass(frozen=True)
class Training:
    """One training run."""

    algorithm: str = "ppo"
    """One of `ALGORITHMS`."""
    steps: int = 2_000_000
    """Environment steps over all worlds."""
    leg: int = 200_000
    """Steps between two checkpoints; episodes begin anew there, so that a resumed run is the same run."""
    worlds: int = 32
    backend: str = "native"
    """Of the physics: on threads, MuJoCo or 'linear', or thousands of worlds on JAX's device: 'jax', 'warp'."""
    device: str = "cpu"
    """Of the networks: 'cpu', or 'cuda', PyTorch's GPU."""
    seed: int = 0
    imitate: int = 60_000
    """Steps in which the policy first learns from the lumen follower, driving itself (DAgger); 0 for none."""
    layers: tuple[int, ...] = (128, 128)
    learning_rate: float = 3e-4
    anneal: bool = False
    """The learning rate falls evenly to a tenth over all steps."""
    gamma: float = 0.99
    rollout: int = 128
    """PPO: steps of each world between two updates."""
    batch: int = 512
    epochs: int = 6
    """PPO: passes over a rollout."""
    entropy: float = 0.0
    """PPO: weight of the entropy bonus."""
    log_std: float = -2.0
    """PPO: logarithm of the exploration at the start; at -1 a policy that imitates pushes its tip through walls."""
    target_kl: float = 0.03
    """PPO: an update stops when the policy has changed by more than this."""
    normalise: bool = False
    """PPO: observations and rewards are divided by their running deviation; the saved policy has it in its layers."""
    first_push: float = 0.0
    """PPO: push action that the untrained policy's mean begins with [1]."""
    stagger: bool = False
    """The first episodes of a leg are cut at even chances, so that worlds do not all stand at the same depth."""
    ease: tuple[float, float] | None = None
    """Perforation limit at the start [N], and share of the steps over which it falls evenly to the task's."""
    buffer: int = 300_000
    """SAC: transitions remembered."""
    task: TaskConfig = field(default_factory=TaskConfig)

    def __post_init__(self) -> None:
        if self.algorithm not in ALGORITHMS:
            raise InvalidOptionError(f"Algorithm '{self.algorithm}' is not known. Known: {', '.join(ALGORITHMS)}.")
        for name, known in (("backend", BACKENDS), ("device", DEVICES)):
            if getattr(self, name) not in known:
                raise InvalidOptionError(f"The {name} '{getattr(self, name)}' is not known. Known: {', '.join(known)}.")
        for name in ("steps", "leg", "worlds", "rollout", "batch", "epochs", "buffer"):
            if getattr(self, name) < 1:
                raise InvalidOptionError(f"{name} is {getattr(self, name)}; give at least 1.")
        if set(sizes(self.task)) & set(IN_BYTES):
            raise InvalidOptionError("The shipped training has no network for pictures: choose state, lumen or dict.")
        if self.normalise and (self.imitate or self.algorithm != "ppo"):
            raise InvalidOptionError("normalise is for PPO without imitation, which learns from bare observations.")
        if self.ease and not (self.ease[0] >= self.task.limits.perforation_force and 0 < self.ease[1] <= 1):
            raise InvalidOptionError(f"ease is {self.ease}: give a force above the task's limit and a share up to 1.")

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "Training":
        """Read what `to_json` wrote.

        Raises:
            InvalidOptionError: naming a value that is not known.
        """
        known = {entry.name for entry in fields(cls)}
        if unknown := set(values) - known:
            raise InvalidOptionError(
                f"A training has no value '{sorted(unknown)[0]}'. Known: {', '.join(sorted(known))}."
            )
        read = dict(values)
        if "task" in read:
            read["task"] = TaskConfig.from_json(read["task"])
        for name in ("layers", "ease"):
            if read.get(name) is not None:
                read[name] = tuple(read[name])
        return cls(**read)


def shipped(name: str) -> Training:
    """A configuration that ships.

    Raises:
        InvalidOptionError: when there is none of that name.
    """
    if name not in SHIPPED:
        raise InvalidOptionError(f"Training '{name}' is not known. Known: {', '.join(SHIPPED)}.")
    return Training.from_json(json.loads(asset(f"training/{name}.json").read_text(encoding="utf-8")))


def changed(training: Training, **values: Any) -> Training:
    """The training with those values that are not None."""
    return replace(training, **{name: value for name, value in values.items() if value is not None})
