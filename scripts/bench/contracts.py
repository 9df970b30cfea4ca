"""Whether environments keep the contracts of Gymnasium and Stable-Baselines3, episode by episode."""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.env_checker import check_env

from haustra.envs.tasks.config import OBSERVATIONS
from haustra.envs.tasks.device_env import DeviceEnv
from haustra.envs.tasks.navigation import NavigationEnv

_PICTURES = {"picture_size": 36}
"""Rows of pictures: networks for pictures take no fewer."""
_STEPS = 5
"""Control steps of each episode beside those of the checkers."""

Make = Callable[[], gymnasium.Env]


@dataclass(frozen=True)
class Kept:
    """What the checks of one environment found."""

    environment: str
    episodes: int
    problems: tuple[str, ...]
    """Each once, with the seed that it was first seen with."""
    seconds: float


def every_environment(**own: Mapping[str, Any]) -> Iterator[tuple[str, Make]]:
    """Every id in every mode of observation, by name.

    Args:
        own: keywords of all environments of an id: 'scope', 'withdrawal', 'device'.
    """
    modes: list[dict[str, Any]] = [{"observation": mode} for mode in OBSERVATIONS]
    full = {
        "observation": "dict",
        "privileged": True,
        "imager": True,
        "memory": (1.0,),
        "depth": True,
        "pictures": True,
    }
    modes.append(full)
    for task, key in (("insertion", "scope"), ("withdrawal", "withdrawal")):
        for mode in modes:
            options = {"task": task, **_PICTURES, **mode, **own.get(key, {})}
            name = "dict, all of it" if mode is full else mode["observation"]
            yield f"{task}, {name}", lambda options=options: NavigationEnv(render_mode="rgb_array", **options)
    for device in ("adult", "capsule", "tracked-steered"):
        yield f"device {device}", lambda device=device: DeviceEnv(device, **own.get("device", {}))


def check(name: str, make: Make, *, seeds: int, tell: Callable[[int], None] = lambda done: None) -> Kept:
    """Let both libraries check one environment, with episodes of that many seeds.

    Args:
        name: for the result.
        make: makes it.
        seeds: episodes are drawn by seeds 0, 1, … in each of the checkers.
        tell: told how many seeds are done.
    """
    from stable_baselines3.common.env_checker import check_env as check_for_sb3

    began, problems = time.perf_counter(), dict[str, int]()
    environment = make()
    for seed in range(seeds):
        seeded = _Seeded(environment, seed)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", message=".*is different from the unwrapped version.*")
            warnings.filterwarnings("ignore", message=".*alternative render modes.*")
            warnings.filterwarnings("ignore", message=".*render fps.*")
            drawn = seed == 0 and environment.metadata["render_modes"]
            for run in (
                partial(check_env, seeded, skip_render_check=not drawn),
                partial(check_for_sb3, seeded, warn=False),
                partial(_episode, environment, seed),
            ):
                try:
                    run()
                except Exception as error:  # whatever a checker raises is a finding
                    problems.setdefault(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}", seed)
        tell(seed + 1)
    environment.close()
    found = tuple(f"{said} (seed {seed})" for said, seed in problems.items())
    return Kept(name, 3 * seeds, found, time.perf_counter() - began)


class _Seeded(gymnasium.Wrapper):
    """Environment whose seeds are shifted: checkers always use the same ones."""

    def __init__(self, environment: gymnasium.Env, shift: int) -> None:
        super().__init__(environment)
        self._shift = shift

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin the episode of another seed."""
        return self.env.reset(seed=None if seed is None else seed + self._shift, options=options)


def _episode(environment: gymnasium.Env, seed: int) -> None:
    """Random actions: what is seen is in its space and finite, as rewards are, and `info` keeps its entries."""
    seen, told = environment.reset(seed=seed)
    environment.action_space.seed(seed)
    for _ in range(_STEPS):
        assert environment.observation_space.contains(seen), "an observation is outside its space"
        seen, reward, over, late, info = environment.step(environment.action_space.sample())
        assert np.isfinite(float(reward)), "a reward is not finite"
        assert info.keys() == told.keys(), f"info changes its entries: {sorted(info.keys() ^ told.keys())}"
        for name, value in info.items():
            assert np.shape(value) == np.shape(told[name]), f"info's '{name}' changes its shape"
            assert isinstance(value, str) or np.isfinite(value).all(), f"info's '{name}' is not finite"
        if over or late:
            seen, told = environment.reset()
