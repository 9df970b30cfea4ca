"""The state of a training run as numbers in files: parameters, optimisers, what is remembered. No pickle."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import load_file, save_file

from haustra.errors import HaustraError, UnreadableFileError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.reading import LARGEST_RECORD, read_document

_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def save_checkpoint(folder: Path, model: Any, document: dict[str, Any]) -> None:
    """Write a model of Stable-Baselines3; `document` is written last and makes it valid.

    Raises:
        OutputError: when it cannot be written.
    """
    prepare_folder(folder)
    tensors, plain = _pack(model)
    number = int(document["steps_done"])
    write_atomically(folder / f"state-{number}.safetensors", lambda temporary: save_file(tensors, temporary))
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        arrays: dict[str, Any] = {name: getattr(buffer, name) for name in _BUFFER}

        def write(temporary: Path) -> None:
            with temporary.open("wb") as file:
                np.savez(file, place=np.array([buffer.pos, int(buffer.full)]), **arrays)

        write_atomically(folder / f"buffer-{number}.npz", write)
    write_json(folder / "checkpoint.json", document | {"plain": plain})
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


def restore(folder: Path, model: Any, document: dict[str, Any]) -> None:
    """Put a model where the checkpoint left it.

    Raises:
        UnreadableFileError: when its files are gone or do not fit.
    """
    number = int(document["steps_done"])
    try:
        _unpack(model, load_file(folder / f"state-{number}.safetensors"), document["plain"])
        buffer = getattr(model, "replay_buffer", None)
        if buffer is not None:
            with np.load(folder / f"buffer-{number}.npz", allow_pickle=False) as file:
                for name in _BUFFER:
                    getattr(buffer, name)[...] = file[name]
                buffer.pos, buffer.full = int(file["place"][0]), bool(file["place"][1])
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise UnreadableFileError(f"The checkpoint in '{folder}' is damaged ({error}): train anew.") from error
    model.num_timesteps, model._n_updates = number, int(document["plain"]["updates"])


def _pack(model: Any) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Tensors by name, and the numbers of optimisers that are none."""
    tensors: dict[str, torch.Tensor] = {}
    groups: dict[str, Any] = {}
    for name, part in model.get_parameters().items():
        if "optimizer" not in name:
            tensors |= {f"{name}/{key}": value.detach().clone().contiguous() for key, value in part.items()}
            continue
        for index, values in part["state"].items():
            for key, value in values.items():
                tensors[f"{name}/{index}/{key}"] = torch.as_tensor(value).clone().contiguous()
        groups[name] = part["param_groups"]
    if getattr(model, "log_ent_coef", None) is not None:
        tensors["log_ent_coef"] = model.log_ent_coef.detach().clone()
    return tensors, {"groups": groups, "updates": model._n_updates}


def _unpack(model: Any, tensors: dict[str, torch.Tensor], plain: dict[str, Any]) -> None:
    parts: dict[str, Any] = {}
    for name in model.get_parameters():
        mine = {key[len(name) + 1 :]: value for key, value in tensors.items() if key.startswith(f"{name}/")}
        if "optimizer" not in name:
            parts[name] = mine
            continue
        states: dict[int, dict[str, torch.Tensor]] = {}
        for key, value in mine.items():
            index, _, entry = key.partition("/")
            states.setdefault(int(index), {})[entry] = value
        parts[name] = {"state": states, "param_groups": plain["groups"][name]}
    model.set_parameters(parts, exact_match=True)
    if "log_ent_coef" in tensors:
        model.log_ent_coef.data.copy_(tensors["log_ent_coef"])
