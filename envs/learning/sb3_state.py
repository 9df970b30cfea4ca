"""The state of a model of Stable-Baselines3 as tensors, plain numbers, and what it remembers of episodes."""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from haustra.envs.learning.checkpoint import below, flat_states, nested_states

_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def buffer_of(model: Any) -> dict[str, np.ndarray] | None:
    """What a model remembers of episodes, if it does."""
    buffer = getattr(model, "replay_buffer", None)
    if buffer is None:
        return None
    return {name: getattr(buffer, name) for name in _BUFFER} | {"place": np.array([buffer.pos, int(buffer.full)])}


def refill(model: Any, path: Path) -> None:
    """Let a model remember what a file holds, if it remembers anything."""
    buffer = getattr(model, "replay_buffer", None)
    if buffer is None:
        return
    with np.load(path, allow_pickle=False) as file:
        for name in _BUFFER:
            getattr(buffer, name)[...] = file[name]
        buffer.pos, buffer.full = int(file["place"][0]), bool(file["place"][1])


def packed(model: Any) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Tensors by name, and the numbers of optimisers that are none."""
    tensors: dict[str, torch.Tensor] = {}
    groups: dict[str, Any] = {}
    for name, part in model.get_parameters().items():
        if "optimizer" not in name:
            tensors |= {f"{name}/{key}": value.detach().clone().contiguous() for key, value in part.items()}
            continue
        tensors |= {f"{name}/{key}": value for key, value in flat_states(part["state"]).items()}
        groups[name] = part["param_groups"]
    if getattr(model, "log_ent_coef", None) is not None:
        tensors["log_ent_coef"] = model.log_ent_coef.detach().clone()
    return tensors, {"groups": groups, "updates": model._n_updates}


def unpack(model: Any, tensors: dict[str, torch.Tensor], plain: dict[str, Any]) -> None:
    """Put a model where `packed` found one."""
    parts: dict[str, Any] = {}
    for name in model.get_parameters():
        mine = below(name, tensors)
        if "optimizer" not in name:
            parts[name] = mine
            continue
        parts[name] = {"state": nested_states(mine), "param_groups": plain["groups"][name]}
    model.set_parameters(parts, exact_match=True)
    if "log_ent_coef" in tensors:
        model.log_ent_coef.data.copy_(tensors["log_ent_coef"])
    model._n_updates = int(plain["updates"])
