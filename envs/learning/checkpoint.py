"""The state of a training run as numbers in files: parameters, optimisers, what is remembered. No pickle."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file

from haustra.errors import HaustraError, UnreadableFileError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.reading import LARGEST_RECORD, read_document


def save_checkpoint(
    folder: Path,
    tensors: dict[str, torch.Tensor],
    document: dict[str, Any],
    buffer: dict[str, np.ndarray] | None = None,
) -> None:
    """Write a state, and what is remembered besides; `document` is written last and makes it valid.

    Raises:
        OutputError: when it cannot be written.
    """
    prepare_folder(folder)
    number = int(document["steps_done"])
    write_atomically(folder / f"state-{number}.safetensors", lambda temporary: save_file(tensors, temporary))
    if buffer is not None:

        def write(temporary: Path) -> None:
            with temporary.open("wb") as file:
                np.savez(file, **buffer)  # pyright: ignore[reportArgumentType]

        write_atomically(folder / f"buffer-{number}.npz", write)
    write_json(folder / "checkpoint.json", document)
    for old in (*folder.glob("state-*.safetensors"), *folder.glob("buffer-*.npz")):
        if old.stem.partition("-")[2] != str(number):
            old.unlink(missing_ok=True)


def load_checkpoint(folder: Path) -> dict[str, Any]:
    """The document of the last checkpoint.

    Raises:
        UnreadableFileError: when there is none.
    """
    try:
        document = read_document(folder / "checkpoint.json", "checkpoint", largest=LARGEST_RECORD)
        if not {"steps_done", "leg", "training", "plain"} <= set(document):
            raise ValueError("entries are missing")
    except (HaustraError, ValueError, TypeError) as error:
        raise UnreadableFileError(f"'{folder}' holds no checkpoint ({error}): train without --resume.") from error
    return document


def restore(folder: Path, document: dict[str, Any], take: Callable[[dict[str, torch.Tensor], Path], None]) -> None:
    """Read the state that a checkpoint's document names.

    Args:
        folder: of the training.
        document: of the checkpoint.
        take: puts a model there, given the tensors and where what is remembered besides would lie.

    Raises:
        UnreadableFileError: when its files are gone or do not fit.
    """
    number = int(document["steps_done"])
    try:
        take(load_file(folder / f"state-{number}.safetensors"), folder / f"buffer-{number}.npz")
    except (OSError, ValueError, KeyError, IndexError, RuntimeError, SafetensorError) as error:
        raise UnreadableFileError(f"The checkpoint in '{folder}' is damaged ({error}): train anew.") from error


def flat_states(states: dict[int, dict[str, Any]]) -> dict[str, torch.Tensor]:
    """What an optimiser keeps of each parameter, as tensors named 'parameter/entry'."""
    return {
        f"{index}/{entry}": torch.as_tensor(value).clone().contiguous()
        for index, values in states.items()
        for entry, value in values.items()
    }


def nested_states(tensors: dict[str, torch.Tensor]) -> dict[int, dict[str, torch.Tensor]]:
    """What an optimiser keeps of each parameter, from the tensors of `flat_states`."""
    states: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in tensors.items():
        index, _, entry = name.partition("/")
        states.setdefault(int(index), {})[entry] = value
    return states


def learned(name: str, network: torch.nn.Module, optimiser: torch.optim.Optimizer) -> dict[str, torch.Tensor]:
    """What a network and its optimiser hold, as tensors named 'name/entry' and 'optimiser/parameter/entry'."""
    tensors = {f"{name}/{entry}": value.contiguous() for entry, value in network.state_dict().items()}
    states = flat_states(optimiser.state_dict()["state"])
    return tensors | {f"optimiser/{entry}": value for entry, value in states.items()}


def put_back(
    tensors: dict[str, torch.Tensor], name: str, network: torch.nn.Module, optimiser: torch.optim.Optimizer
) -> None:
    """Let a network and its optimiser hold again what `learned` told."""
    network.load_state_dict(below(name, tensors))
    groups = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": nested_states(below("optimiser", tensors)), "param_groups": groups})


def below(prefix: str, tensors: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Tensors whose names begin with 'prefix/', by the rest of their names."""
    return {name[len(prefix) + 1 :]: value for name, value in tensors.items() if name.startswith(f"{prefix}/")}
