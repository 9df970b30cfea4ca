"""Gymnasium environments of one scope: insertion to the caecum, and withdrawal."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import actions_of
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.calls import checked_action, require_no_options
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.fields import Number, shown

RENDER_MODES = ("rgb_array", "depth_array", "human")
_PICTURE = 240
"""Rows and columns of a rendered picture."""


def observation_space(config: TaskConfig) -> spaces.Space:
    """What one world sees: a Box in the modes state, lumen, depth and pixels, a Dict in mode dict."""
    boxes: dict[str, spaces.Space] = {name: _box(name, shape) for name, shape in seen_by.sizes(config).items()}
    return spaces.Dict(boxes) if config.observation == "dict" else boxes[config.observation]


def action_space(config: TaskConfig) -> spaces.Box:
    """Push, roll, tip up, tip left, and gas where the task asks for it, each from -1 to 1."""
    return spaces.Box(-1.0, 1.0, (len(actions_of(config)),), np.float32)


def configured(config: TaskConfig | dict[str, Any] | None, options: dict[str, Any]) -> TaskConfig:
    """A configuration from a whole one, from JSON values, or from single options."""
    whole = config.to_json() if isinstance(config, TaskConfig) else config
    base = TaskConfig().to_json() | (whole or {})
    return TaskConfig.from_json(base | options)


class NavigationEnv(gymnasium.Env):
    """A tendon-steered scope in a colon drawn by the episode's seed.

    Options are the fields of `haustra.envs.tasks.config.TaskConfig`: `gym.make("Haustra/Colonoscopy-v0",
    observation="state", difficulty="easy")`. `info` holds ground truth and the reward's terms.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 25}  # noqa: RUF012

    def __init__(
        self,
        config: TaskConfig | dict[str, Any] | None = None,
        *,
        bank: ColonSet | None = None,
        backend: str = "native",
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """Build the bank, or take one; `backend` is 'native', or 'linear', which alone has gas.

        Raises:
            InvalidOptionError: when an option or the render mode is not known.
        """
        if render_mode not in (None, *RENDER_MODES):
            raise InvalidOptionError(f"Render mode '{render_mode}' is not known. Known: {', '.join(RENDER_MODES)}.")
        self.config = configured(config, options)
        self.task = ScopeTask(self.config, backend=backend, bank=bank)
        self.render_mode = render_mode
        self.observation_space = observation_space(self.config)
        self.action_space = action_space(self.config)
        self._window: Any = None
        self._began = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; `options={"case": k}` chooses the k-th colon of the bank."""
        super().reset(seed=seed)
        if seed is None and not self._began:
            seed = int(self.np_random.integers(2**31))
        require_no_options(options, "case")
        case = None if not options else options.get("case")
        if case is not None and Number("1", 0, len(self.task.bank.cases) - 1, whole=True).wrong(case):
            raise InvalidOptionError(
                f"Case {shown(case)} is not in the bank: it has {len(self.task.bank.cases)} colons."
            )
        seen = self.task.reset(seeds=None if seed is None else [seed], case=case)
        self._began = True
        if self.render_mode == "human":
            self.render()
        return self._one(seen), _first(self.task.info())

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One action of `TaskConfig.drive.control_interval`.

        Raises:
            InvalidOptionError: before the first reset, or when the action is not a number for each of the task's.
        """
        if not self._began:
            raise InvalidOptionError("The environment was not reset: call reset first.")
        done = self.task.step(checked_action(action, (len(actions_of(self.config)),))[None])
        if self.render_mode == "human":
            self.render()
        return (
            self._one(done.observation),
            float(done.reward[0]),
            bool(done.terminated[0]),
            bool(done.truncated[0]),
            _first(done.info),
        )

    def render(self) -> Any:
        """The tip's view: colour, depth in metres, or a window."""
        if self.render_mode == "depth_array":
            return self.task.render_depth(0, _PICTURE)
        picture = self.task.render(0, _PICTURE) if self.render_mode else None
        if self.render_mode != "human":
            return picture
        from haustra.envs.view.picture.window import Window

        self._window = self._window or Window("haustra")
        self._window.show(picture)
        return None

    def close(self) -> None:
        """End threads and window."""
        self.task.close()
        if self._window:
            self._window.close()
            self._window = None

    def _one(self, seen: seen_by.Observation) -> Any:
        if self.config.observation == "dict":
            return {name: seen[name][0] for name in self.task.parts}
        return seen[self.config.observation][0]


def _box(name: str, shape: tuple[int, ...]) -> spaces.Box:
    if name in seen_by.IN_BYTES:
        return spaces.Box(0, 255, shape, np.uint8)
    return spaces.Box(-seen_by.bound(), seen_by.bound(), shape, np.float32)


def _first(info: dict[str, np.ndarray]) -> dict[str, Any]:
    """What is said of the first world, as plain values."""
    return {name: value[0].item() if np.ndim(value[0]) == 0 else np.array(value[0]) for name, value in info.items()}
