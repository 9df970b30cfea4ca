"""How a policy is trained: the algorithm's numbers and the task, as one JSON value; the shipped configurations."""

import json
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from haustra.assets import asset
from haustra.envs.sim.device_worlds import NAMES as BACKENDS_OF_DEVICES
from haustra.envs.sim.load import NAMES
from haustra.envs.tasks.config import Drive, TaskConfig
from haustra.envs.tasks.device_task import DeviceRules
from haustra.envs.tasks.observation import IN_BYTES, sizes
from haustra.errors import InvalidOptionError
from haustra.fields import Number, choice, number, read_fields, require_declared, several, vector, whole

ALGORITHMS = ("ppo", "sac")
DEVICES = ("cpu", "cuda")
LEARNERS = ("sb3", "device", "eyes")
SHIPPED = (
    "insertion",
    "insertion-ppo",
    "insertion-cpu",
    "insertion-gpu",
    "insertion-depth",
    "insertion-colour",
    "insertion-sb3",
    "insertion-easy",
    "insertion-sac",
    "for-a-design",
    "inchworm",
    "quick",
    "tracked",
    "withdrawal",
)
"""Configurations in assets/training."""


@dataclass(frozen=True)
class Training:
    """One training run."""

    algorithm: str = choice(*ALGORITHMS, default="ppo")
    """Learning algorithm: proximal policy optimisation ('ppo') or soft actor-critic ('sac')."""
    learner: str = choice(*LEARNERS, default="sb3")
    """Who learns: Stable-Baselines3 ('sb3'); PPO whose arrays stay where the physics has them ('device'), on
    'linear-gpu' and 'linear' alone; or, there too, the eyes of the policy `start`, which sees depth, from pictures in
    colour ('eyes')."""
    steps: int = whole(1, 10**12, default=2_000_000)
    """Length of the training in environment steps, counted over all worlds."""
    leg: int = whole(1, 10**12, default=200_000)
    """Environment steps between two checkpoints; episodes begin anew there, so that a resumed run is the same run."""
    worlds: int = whole(1, 1_000_000, default=32)
    """Number of scopes that are stepped at once."""
    backend: str = choice(*NAMES, default="native")
    """What computes the physics: 'native' or 'linear' on threads, or thousands of worlds on a GPU by 'linear-gpu' or
    'warp'."""
    device: str = choice(*DEVICES, default="cpu")
    """Where the networks are computed: 'cpu', or 'cuda', PyTorch's GPU."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of all random draws."""
    imitate: int = whole(0, 10**12, default=60_000)
    """Number of steps in which the policy first learns from the lumen follower, a device that is no scope from its own
    driver, or on the device, in withdrawals alone, from the driver 'inspect', driving itself (DAgger); 0 for none."""
    demonstrations: str | None = None
    """Folder of recordings of episodes that the policy first learns from (behaviour cloning), instead of `imitate`."""
    layers: tuple[int, ...] = several("1", 1, 8192, default=(128, 128), least=1, most=16, whole=True)
    """Widths of the networks' hidden layers."""
    learning_rate: float = number("1", 1e-9, 1.0, default=3e-4)
    """Learning rate of the optimiser; where it is annealed, at the start [1]."""
    anneal: bool = False
    """Let the learning rate fall evenly to a tenth over all steps."""
    gamma: float = number("1", 0.0, 1.0, default=0.99)
    """Discount of a reward for each control step that it comes later [1]."""
    rollout: int = whole(1, 1_000_000, default=128)
    """PPO: number of steps of each world between two updates."""
    batch: int = whole(1, 10**8, default=512)
    """Number of samples in one step of the optimiser."""
    epochs: int = whole(1, 10_000, default=6)
    """PPO: number of passes over a rollout."""
    entropy: float = number("1", 0.0, 100.0, default=0.0)
    """PPO: weight of the entropy bonus."""
    log_std: float = number("1", -20.0, 2.0, default=-2.0)
    """PPO: logarithm of the actions' standard deviation at the start; at -1 a policy that imitates pushes its tip
    through walls."""
    target_kl: float = number("1", 1e-6, 1e3, default=0.03)
    """PPO: Kullback-Leibler divergence from the old policy at which an update stops [1]."""
    normalise: bool = False
    """PPO: observations and rewards are divided by their running deviation; the saved policy has it in its layers."""
    first_push: float = number("1", -1.0, 1.0, default=0.0)
    """PPO: push action that the untrained policy's mean begins with [1]."""
    stagger: bool = False
    """Cut the first episodes of a leg at even chances, so that worlds do not all stand at the same depth."""
    ease: tuple[float, float] | None = vector(Number("N", 0.01, 1e4), Number("1", 0.001, 1.0), default=None)
    """Perforation limit at the start [N], and share of the steps over which it falls evenly to the task's."""
    trace: float = number("1", 0.0, 1.0, default=0.95)
    """PPO on the device: how far advantages look beyond one step before they trust the critic (lambda) [1]."""
    start: str | None = None
    """PPO on the device: policy to begin as, a shipped one's name or a folder."""
    critic_knows: bool = False
    """PPO on the device: the critic also reads what no device knows (`task.privileged`), and all that the policy does
    not see."""
    recalls: tuple[float, ...] = several("s", 0.01, 600.0, default=(), most=8)
    """PPO on the device: the policy itself keeps its last action, and means of what it saw and did that forget by 1/e
    within each of these times [s]; none when empty."""
    most_p_perforation: float | None = number("1", 1e-6, 1.0, default=None)
    """PPO on the device: limit of the mean share of people whose colon an episode would tear [1]."""
    most_pain: float | None = number("1", 1e-3, 1e3, default=None)
    """PPO on the device: limit of the mean largest pain of an episode, 1 where it is taken to begin [1]."""
    prices: tuple[float, float] = vector(Number("1", 1e-4, 1e4), Number("1", 1e-4, 1e4), default=(0.1, 2.0))
    """Price of each limit at the start, and the highest it may rise to [1]: what a deviation of its cost takes off, in
    deviations of the reward."""
    price_rate: float = number("1", 0.0, 10.0, default=0.03)
    """Share by which a price rises or falls in a rollout while episodes cost twice the limit, or nothing [1]."""
    least_reached: float = number("1", 0.0, 1.0, default=0.0)
    """Share of episodes that must reach the end for prices to rise; while fewer do, they fall [1]."""
    buffer: int = whole(1, 10**9, default=300_000)
    """SAC: number of transitions remembered."""
    driven: Drive | None = None
    """How the policy drives once it is trained, with a gentler hand than it learned with; as in training when None."""
    task: TaskConfig = field(default_factory=TaskConfig)
    """What a scope is to do."""
    drives: DeviceRules | None = None
    """Any device that is driven by its declared controls in place of a scope: `task` is not read then."""

    def __post_init__(self) -> None:
        require_declared(self)
        if self.drives is not None:
            self._require_drives()
        if self.learner == "device":
            self._require_device()
        elif self.learner == "eyes":
            self._require_eyes()
        elif others := [name for name in _ON_DEVICE if getattr(self, name) != getattr(Training, name)]:
            raise InvalidOptionError(f"{others[0]} is for the learner 'device': leave it out, or set learner.")
        if self.learner != "eyes" and set(sizes(self.task)) & set(IN_BYTES):
            raise InvalidOptionError("The shipped training has no network for pictures: choose state, lumen or dict.")
        if self.demonstrations is not None and self.imitate:
            raise InvalidOptionError("A policy first learns from demonstrations or by imitate: set imitate to 0.")
        imitates = self.imitate and self.learner != "device"
        if self.normalise and (imitates or self.demonstrations or self.algorithm != "ppo"):
            raise InvalidOptionError("normalise is for PPO without imitation, which learns from bare observations.")
        if self.ease and self.ease[0] < self.task.limits.perforation_force:
            raise InvalidOptionError(
                f"ease is {self.ease}: give at least the task's limit, {self.task.limits.perforation_force:g} N."
            )

    def _require_drives(self) -> None:
        """Refuse what only scopes have."""
        given = [name for name in _OF_SCOPES if getattr(self, name) != getattr(Training, name)]
        if self.learner != "sb3" or self.backend not in BACKENDS_OF_DEVICES or self.task != TaskConfig() or given:
            raise InvalidOptionError(
                "A training that drives another device than a scope is for the learner 'sb3' on the backends "
                f"{' and '.join(BACKENDS_OF_DEVICES)}, without {', '.join(('task', *_OF_SCOPES))}: set these."
            )

    def _require_device(self) -> None:
        """Refuse what PPO on the device does not do."""
        linear = self.backend.startswith("linear")
        taught = self.imitate and (self.task.task != "withdrawal" or self.recalls or self.start is not None)
        if self.algorithm != "ppo" or not linear or taught or self.demonstrations or not self.normalise:
            raise InvalidOptionError(
                "The learner 'device' is for PPO on the backends 'linear' and 'linear-gpu', normalised and without "
                "imitation but in withdrawals, without recall or another start: set these, or use the learner 'sb3'."
            )
        if (self.backend == "linear-gpu") != (self.device == "cuda"):
            raise InvalidOptionError("The learner 'device' learns where the physics is: 'linear-gpu' goes with 'cuda'.")

    def _require_eyes(self) -> None:
        """Refuse what eyes do not learn from."""
        if self.task.observation != "pixels" or self.start is None or not self.backend.startswith("linear"):
            raise InvalidOptionError(
                "The learner 'eyes' is for the observation 'pixels' on the backends 'linear' and 'linear-gpu', and "
                "needs a policy to `start` from, which drives by the lumen: set these."
            )
        if others := [
            name for name in _ON_DEVICE if name != "start" and getattr(self, name) != getattr(Training, name)
        ]:
            raise InvalidOptionError(f"{others[0]} is for the learner 'device': leave it out, or set learner.")
        if self.batch < 8:
            raise InvalidOptionError(f"batch is {self.batch}: give at least 8, since eyes learn from 8 looks.")
        if (self.backend == "linear-gpu") != (self.device == "cuda"):
            raise InvalidOptionError("The learner 'eyes' learns where the physics is: 'linear-gpu' goes with 'cuda'.")

    @property
    def task_then(self) -> TaskConfig:
        """The task of the trained policy."""
        return self.task if self.driven is None else replace(self.task, drive=self.driven)

    @property
    def shown(self) -> TaskConfig:
        """The task with all that is read in training: by a critic that knows more, every part of an observation."""
        if self.learner == "eyes":
            return replace(self.task, observation="dict", pictures=True)
        return replace(self.task, observation="dict", privileged=True) if self.critic_knows else self.task

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "Training":
        """Read what `to_json` wrote.

        Raises:
            InvalidOptionError: naming a value that is not known or out of its range.
        """
        return read_fields(cls, values)


_OF_SCOPES = ("demonstrations", "ease", "stagger", "first_push", "driven")
"""What a training of another device cannot have."""
_ON_DEVICE = (
    *("trace", "start", "critic_knows", "recalls"),
    *("most_p_perforation", "most_pain", "prices", "price_rate", "least_reached"),
)
"""What only PPO on the device reads."""


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
