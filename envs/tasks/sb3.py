"""The vector environment as Stable-Baselines3 wants it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Dict, flatten_space
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.spaces import spaces_of


class TaskVecEnv(VecEnv):
    """Worlds of one task; an episode that is over begins anew at once, its last observation in `info`."""

    def __init__(self, task: ScopeTask | DeviceTask, *, flat: bool = False, stagger: bool = False) -> None:
        """Wrap a task.

        Args:
            task: the worlds.
            flat: put the parts of an observation side by side, as `Driver`s and policies read them.
            stagger: cut the first episodes after a reset at even chances, so that worlds are not all equally far.
        """
        self.task, self.render_mode, self._flat, self._stagger = task, None, flat, stagger
        space, actions = spaces_of(task)
        super().__init__(task.worlds, flatten_space(space) if flat else space, actions)
        self._action = np.zeros((task.worlds, *actions.shape))
        self._return, self._length = np.zeros(task.worlds), np.zeros(task.worlds, int)

    def reset(self) -> Any:
        """Begin anew everywhere, with the seeds that `seed` set."""
        seeds = [int(seed) for seed in self._seeds if seed is not None]
        seen = self.task.reset(seeds=seeds if len(seeds) == self.num_envs else None)
        if self._stagger and isinstance(self.task, ScopeTask):
            self.task.stagger(seeds[0] if seeds else 0)
        self._reset_seeds()
        self._return[:], self._length[:] = 0.0, 0
        return self._shown(seen)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions."""
        self._action = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Apply them."""
        done = self.task.step(self._action)
        over = done.terminated | done.truncated
        self._return += done.reward
        self._length += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        shown = self._shown(done.observation)
        if over.any():
            for world in np.flatnonzero(over):
                infos[world] = {
                    **{name: values[world] for name, values in done.info.items()},
                    "terminal_observation": _row(shown, int(world)),
                    "TimeLimit.truncated": bool(done.truncated[world]),
                    "episode": {"r": float(self._return[world]), "l": int(self._length[world])},
                }
            self._return[over], self._length[over] = 0.0, 0
            shown = self._shown(self.task.reset(np.flatnonzero(over)))
        return shown, done.reward.astype(np.float32), over, infos

    def close(self) -> None:
        """End the threads."""
        self.task.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the whole, for each of some worlds."""
        return [getattr(self, attr_name)] * len(self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the whole."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the whole, once for each of some worlds."""
        return [getattr(self, method_name)(*args, **kwargs) for _ in self._rows(indices)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No world is wrapped on its own."""
        return [False] * len(self._rows(indices))

    def _rows(self, indices: Any) -> Sequence[int]:
        return range(self.num_envs) if indices is None else np.atleast_1d(indices).tolist()

    def _shown(self, seen: Any) -> Any:
        if self._flat:
            return seen_by.flat(seen)
        if isinstance(self.observation_space, Dict):
            return {name: seen[name] for name in self.observation_space.spaces}
        return next(iter(seen.values()))


def _row(shown: Any, world: int) -> Any:
    return {name: values[world] for name, values in shown.items()} if isinstance(shown, dict) else shown[world]
