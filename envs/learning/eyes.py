"""Eyes of a policy that sees colour: layers that tell from a picture how far the wall is along the lumen's rays."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from numpy.lib.stride_tricks import sliding_window_view

from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.sight import RANGE, ray_directions

STRIDE = 2
"""Each convolution halves the picture [1]."""
COLOURS = 3
"""Red, green and blue; the distance that pictures have as a fourth channel is not looked at [1]."""
RAYS = len(ray_directions())
"""Distances that eyes tell [1]."""


@dataclass(frozen=True)
class Eyes:
    """Convolutions with ReLU behind each, a hidden layer likewise, and a sigmoid for each ray's distance."""

    kernels: tuple[Float[np.ndarray, "_ _ _ _"], ...]
    """Outputs, inputs, rows and columns, convolution by convolution; rows and columns are odd and alike."""
    shifts: tuple[Float[np.ndarray, " _"], ...]
    weights: tuple[Float[np.ndarray, "_ _"], Float[np.ndarray, "_ _"]]
    """Outputs times inputs of the hidden layer, and of the last."""
    biases: tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"]]

    def look(self, pictures: UInt8[np.ndarray, "worlds size size channels"]) -> Float[np.ndarray, "worlds lumen"]:
        """What `haustra.envs.tasks.observation.lumen` says, as far as a picture shows it."""
        value = np.moveaxis(pictures[..., :COLOURS], -1, 1).astype(np.float32) / 255.0
        for kernel, shift in zip(self.kernels, self.shifts, strict=True):
            value = np.maximum(_convolved(value, kernel) + shift[:, None, None], 0.0)
        value = value.reshape(len(value), -1)
        (hidden, last), (first, second) = self.weights, self.biases
        value = np.maximum(value @ hidden.T + first, 0.0)
        near = 0.5 + 0.5 * np.tanh(0.5 * (value @ last.T + second))  # a sigmoid that does not overflow
        return seen_by.lumen(RANGE * near)

    def fits(self, size: int) -> bool:
        """Whether the layers fit each other and pictures of that size, and hold numbers."""
        channels, width = COLOURS, size
        for kernel, shift in zip(self.kernels, self.shifts, strict=True):
            outputs, inputs, rows, columns = kernel.shape
            if inputs != channels or rows != columns or rows % 2 == 0 or shift.shape != (outputs,):
                return False
            channels, width = outputs, (width - 1) // STRIDE + 1
        (hidden, last), (first, second) = self.weights, self.biases
        shaped = hidden.shape == (len(first), channels * width**2) and last.shape == (RAYS, len(first))
        every = (*self.kernels, *self.shifts, *self.weights, *self.biases)
        return bool(self.kernels) and shaped and second.shape == (RAYS,) and all(np.isfinite(e).all() for e in every)

    def arrays(self) -> dict[str, np.ndarray]:
        """All numbers by names."""
        found = {f"eyes.kernel.{layer}": kernel for layer, kernel in enumerate(self.kernels)}
        found |= {f"eyes.shift.{layer}": shift for layer, shift in enumerate(self.shifts)}
        found |= {f"eyes.weight.{layer}": weight for layer, weight in enumerate(self.weights)}
        return found | {f"eyes.bias.{layer}": bias for layer, bias in enumerate(self.biases)}

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> "Eyes | None":
        """From `arrays`; None where there are none.

        Raises:
            KeyError: when some are missing.
        """
        layers = range(sum(name.startswith("eyes.kernel.") for name in arrays))
        if not layers:
            return None
        kernels, shifts = (tuple(arrays[f"eyes.{part}.{layer}"] for layer in layers) for part in ("kernel", "shift"))
        weights, biases = ((arrays[f"eyes.{part}.0"], arrays[f"eyes.{part}.1"]) for part in ("weight", "bias"))
        return cls(kernels, shifts, weights, biases)


def _convolved(
    value: Float[np.ndarray, "worlds inputs size size"], kernel: Float[np.ndarray, "outputs inputs rows rows"]
) -> Float[np.ndarray, "worlds outputs half half"]:
    """Every second place of the convolution with zeros around."""
    around = kernel.shape[-1] // 2
    padded = np.pad(value, ((0, 0), (0, 0), (around, around), (around, around)))
    windows = sliding_window_view(padded, kernel.shape[2:], axis=(2, 3))[:, :, ::STRIDE, ::STRIDE]
    return np.moveaxis(np.tensordot(windows, kernel, axes=((1, 4, 5), (1, 2, 3))), -1, 1)
