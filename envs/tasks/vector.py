"""Many scopes at once as one Gymnasium vector environment, on the threads of one process."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from haustra.envs.tasks.actions import actions_of
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.calls import checked_action, require_no_options
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.navigation import action_space, configured, observation_space
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.fields import shown


class NavigationVectorEnv(VectorEnv):
    """Worlds that are stepped together.

    By default an episode that is over begins anew at the next step, which ignores its action
    (`AutoresetMode.NEXT_STEP`). With `SAME_STEP` it begins anew at once, and `info` holds `final_obs` and `final_info`.
    With `DISABLED` the caller resets, by `reset(options={"reset_mask": mask})`.
    """

    metadata = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        config: TaskConfig | dict[str, Any] | None = None,
        *,
        bank: ColonSet | None = None,
        threads: int = 2,
        backend: str = "native",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Build the bank, or take one; `backend` is 'native' or 'linear' (on threads), 'linear-gpu' or 'warp'.

        Raises:
            InvalidOptionError: when an option is not known or out of its range.
        """
        if render_mode not in (None, "rgb_array"):
            raise InvalidOptionError(f"Render mode '{render_mode}' is not known. Known: rgb_array.")
        self.config = configured(config, options)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.metadata = self.metadata | {"autoreset_mode": AutoresetMode(autoreset_mode)}
        self.task = ScopeTask(self.config, worlds=num_envs, threads=threads, backend=backend, bank=bank)
        self.single_observation_space = observation_space(self.config)
        self.single_action_space = action_space(self.config)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._over = np.zeros(num_envs, bool)
        self._began = False

    def reset(
        self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin anew: all worlds, or those of `options["reset_mask"]`. World i is seeded with `seed` + i."""
        require_no_options(options, "reset_mask")
        mask = (options or {}).get("reset_mask")
        if mask is not None and (np.shape(mask) != (self.num_envs,) or np.asarray(mask).dtype != bool):
            raise InvalidOptionError(f"reset_mask is {shown(mask)}; give {self.num_envs} truths.")
        if isinstance(seed, list) and len(seed) != self.num_envs:
            raise InvalidOptionError(f"There are {len(seed)} seeds for {self.num_envs} worlds.")
        worlds = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        super().reset(seed=seed if isinstance(seed, int) else None)
        if seed is None and not self._began:
            seed = int(self.np_random.integers(2**31))
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        chosen = None if seeds is None else [seeds[world] for world in worlds]
        seen = self.task.reset(worlds, chosen)
        self._over[worlds], self._began = False, True
        return self._shown(seen), _info(self.task.info())

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One action in each world.

        Raises:
            InvalidOptionError: before the first reset, when there is not a number for each action of each world, or
                when an episode is over and nothing resets it.
        """
        if not self._began:
            raise InvalidOptionError("The environment was not reset: call reset first.")
        mode, begins = self.metadata["autoreset_mode"], self._over.copy()
        if mode is AutoresetMode.DISABLED and begins.any():
            raise InvalidOptionError("Episodes are over and autoreset is disabled: reset them with a reset_mask.")
        done = self.task.step(checked_action(actions, (self.num_envs, len(actions_of(self.config)))), begins)
        reward, ended, late = done.reward, done.terminated, done.truncated
        seen, info = done.observation, _info(done.info)
        if begins.any():
            info |= {f"_{name}": ~begins for name in done.info}
        over = ended | late
        if mode is AutoresetMode.SAME_STEP and over.any():
            info = _info({}) | self._final(seen, info, over)
            seen = self.task.reset(np.flatnonzero(over))
            over = np.zeros_like(over)
        self._over = over
        return self._shown(seen), reward, ended, late, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The view of every tip."""
        return tuple(self.task.render(world, 240) for world in range(self.num_envs)) if self.render_mode else None

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        self.task.close()

    def _final(self, seen: Any, info: dict[str, Any], over: np.ndarray) -> dict[str, Any]:
        shown = self._shown(seen)
        final = np.full(self.num_envs, None, object)
        for world in np.flatnonzero(over):
            final[world] = {k: v[world] for k, v in shown.items()} if isinstance(shown, dict) else shown[world]
        last = {name: values for name, values in info.items() if not name.startswith("_")}
        masked = last | {f"_{name}": over.copy() for name in last}
        return info | {"final_obs": final, "_final_obs": over.copy(), "final_info": masked, "_final_info": over.copy()}

    def _shown(self, seen: Any) -> Any:
        return (
            {name: seen[name] for name in self.task.parts}
            if self.config.observation == "dict"
            else next(iter(seen.values()))
        )


def _info(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """As vector environments give it: an array a key, and which worlds it holds for."""
    return {k: v for name, array in arrays.items() for k, v in ((name, array), (f"_{name}", np.ones(len(array), bool)))}
