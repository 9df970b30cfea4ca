"""A trained policy as two files that hold only numbers: weights (safetensors) and what they are for (JSON)."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.envs.learning.eyes import Eyes
from haustra.envs.learning.recall import recalled_width
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import actions_of
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.device_task import DeviceRules, entries_of
from haustra.errors import HaustraError, InvalidOptionError, UnreadableFileError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.devices.base import load_device
from haustra.reading import read_document

WEIGHTS, ABOUT = "policy.safetensors", "policy.json"
"""Names of the two files."""
SHIPPED_POLICIES = (
    "insertion", "insertion-depth", "insertion-colour", "insertion-easy", "withdrawal", "inchworm", "tracked",
)  # fmt: skip
"""Trained policies in assets/policies: for the way in through any colon by all that scope, hand and imager tell, by
depth alone, and by colour alone; through easy ones; for the way out; and for other devices, inchworm and tracked."""
_LARGEST_FILE = 200_000_000
"""No policy of this kind is larger [bytes]."""


@dataclass(frozen=True)
class MlpPolicy:
    """Layers with tanh or ReLU between them: a flat observation in, the mean action out."""

    weights: tuple[Float[np.ndarray, "_ _"], ...]
    """Outputs times inputs, layer by layer."""
    biases: tuple[Float[np.ndarray, " _"], ...]
    activation: str
    """tanh or relu."""
    squashed: bool
    """The last layer goes through tanh (SAC); otherwise it is clipped to -1 .. 1 (PPO)."""
    config: TaskConfig
    """What it was trained on, where it drives a scope."""
    about: dict[str, Any] = field(default_factory=dict)
    """How it was trained: JSON values."""
    deviation: Float[np.ndarray, " actions"] | None = None
    """Standard deviation of the actions that it drew in training (PPO); None when it was not kept."""
    recalls: tuple[float, ...] = ()
    """Times within which its own running means forget by 1/e [s] (`haustra.envs.learning.recall`); none without."""
    eyes: Eyes | None = None
    """What makes of pictures in colour what the layers read; the layers read what is shown when None."""
    drives: DeviceRules | None = None
    """What it was trained on, where it drives another device; then `config` says nothing."""

    @property
    def interval(self) -> float:
        """Time between two of its actions [s]."""
        return self.config.drive.control_interval if self.drives is None else self.drives.control_interval

    @property
    def widths(self) -> tuple[int, int]:
        """How many numbers its layers read of what is shown, and how many actions it has.

        Raises:
            InvalidDesignError: when the device that it drives is not known.
        """
        if self.drives is not None:
            device = load_device(self.drives.device)
            return entries_of(device), len(device.controls)
        if self.eyes is not None:
            return seen_by.LUMEN_SIZE, len(actions_of(self.config))
        sizes = seen_by.sizes(self.config).values()
        return sum(int(np.prod(shape)) for shape in sizes), len(actions_of(self.config))

    def shown(self, seen: seen_by.Observation) -> Float[np.ndarray, "worlds entries"]:
        """What is read of what all worlds see."""
        return seen_by.flat(seen) if self.eyes is None else self.eyes.look(seen["pixels"])

    def act(
        self, read: Float[np.ndarray, "worlds entries"], random: np.random.Generator | None = None
    ) -> Float[np.ndarray, "worlds actions"]:
        """Actions of all worlds: the means, or drawn as in training when given what to draw from.

        Args:
            read: what worlds see side by side, and what the policy recalls.
            random: what to draw from.

        Raises:
            InvalidOptionError: when the policy does not know its deviation.
        """
        value = read.astype(np.float32)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            value = value @ weight.T + bias
            value = np.tanh(value) if self.activation == "tanh" else np.maximum(value, 0.0)
        value = value @ self.weights[-1].T + self.biases[-1]
        if random is not None:
            if self.deviation is None:
                raise InvalidOptionError("The policy does not say how far its actions vary: let it take their means.")
            value = value + self.deviation * random.normal(size=value.shape)
        return (np.tanh(value) if self.squashed else np.clip(value, -1.0, 1.0)).astype(float)


def save_policy(folder: Path, policy: MlpPolicy) -> Path:
    """Write both files into a folder.

    Raises:
        OutputError: when it cannot be written.
    """
    from safetensors.numpy import save

    prepare_folder(folder)
    arrays = {} if policy.eyes is None else policy.eyes.arrays()
    for layer, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        arrays |= {f"{layer}.weight": np.ascontiguousarray(weight), f"{layer}.bias": np.ascontiguousarray(bias)}
    if policy.deviation is not None:
        arrays["deviation"] = np.ascontiguousarray(policy.deviation)
    write_atomically(folder / WEIGHTS, lambda temporary: temporary.write_bytes(save(arrays)))
    document = {
        "format": "haustra policy 1",
        "layers": len(policy.weights),
        "activation": policy.activation,
        "squashed": policy.squashed,
        "recalls": list(policy.recalls),
        **({"task": policy.config.to_json()} if policy.drives is None else {"drives": policy.drives.to_json()}),
        "about": policy.about,
    }
    write_json(folder / ABOUT, document)
    return folder


def policy_folder(name: str) -> Path:
    """Where the policy of that name lies: one that ships, or a folder."""
    return asset(f"policies/{name}/{ABOUT}").parent if name in SHIPPED_POLICIES else Path(name)


def load_policy(folder: Path) -> MlpPolicy:
    """Read a policy that drives a scope; nothing in the files is run.

    Raises:
        UnreadableFileError: when there is none, or its layers do not fit each other or the task.
        InvalidOptionError: when it drives another device.
    """
    policy = load_any_policy(folder)
    if policy.drives is not None:
        raise InvalidOptionError(f"The policy in '{folder}' drives '{policy.drives.device}': name one for a scope.")
    return policy


def load_any_policy(folder: Path) -> MlpPolicy:
    """Read a policy for a scope or another device; nothing in the files is run.

    Raises:
        UnreadableFileError: when there is none, or its layers do not fit each other or what it drives.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        if (folder / WEIGHTS).stat().st_size > _LARGEST_FILE:
            raise UnreadableFileError(f"'{folder / WEIGHTS}' is larger than any policy: name another.")
        document = read_document(folder / ABOUT, "policy")
        arrays = load((folder / WEIGHTS).read_bytes())
        layers = range(int(document["layers"]))
        policy = MlpPolicy(
            weights=tuple(arrays[f"{layer}.weight"] for layer in layers),
            biases=tuple(arrays[f"{layer}.bias"] for layer in layers),
            activation=str(document["activation"]),
            squashed=bool(document["squashed"]),
            config=TaskConfig() if "drives" in document else TaskConfig.from_json(document["task"]),
            drives=DeviceRules.from_json(document["drives"]) if "drives" in document else None,
            about=dict(document["about"]),
            deviation=arrays.get("deviation"),
            recalls=_times(document["recalls"]),
            eyes=Eyes.of(arrays),
        )
        fits = _fits(policy)
    except HaustraError as error:
        raise UnreadableFileError(f"'{folder}' is no policy ({error})") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, SafetensorError) as error:
        raise UnreadableFileError(
            f"'{folder}' is no policy ({type(error).__name__}: {error}): give a folder that `haustra train` wrote."
        ) from error
    if not fits:
        raise UnreadableFileError(f"The layers of '{folder}' fit neither each other nor the task: train it anew.")
    return policy


def _times(values: Any) -> tuple[float, ...]:
    """Times of running means.

    Raises:
        TypeError: when they are no list of numbers.
    """
    if not isinstance(values, list) or any(isinstance(value, (bool, str)) for value in values):
        raise TypeError(f"recalls are {values}")
    return tuple(float(value) for value in values)


def _fits(policy: MlpPolicy) -> bool:
    eyes, (seen, actions) = policy.eyes, policy.widths
    sees = set(seen_by.sizes(policy.config)) if policy.drives is None else set()
    if eyes is not None and (sees != {"pixels"} or not eyes.fits(policy.config.picture_size)):
        return False
    own = recalled_width(seen, actions, len(policy.recalls))
    widths = [own, *(len(bias) for bias in policy.biases)]
    shaped = all(
        weight.shape == (after, before)
        for weight, before, after in zip(policy.weights, widths[:-1], widths[1:], strict=True)
    )
    spread = np.ones(actions) if policy.deviation is None else policy.deviation
    finite = all(np.isfinite(array).all() for array in (*policy.weights, *policy.biases, spread))
    finite = finite and all(0 < time < np.inf for time in policy.recalls)
    drawn = spread.shape == (actions,) and bool((spread >= 0).all())
    return bool(policy.weights) and shaped and finite and drawn and widths[-1] == actions
