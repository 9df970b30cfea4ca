"""A scene and a driver's name in, a finished run out: what `haustra run` calls, and a program of a few lines."""

from typing import Any

from haustra.envs.control.laws import driver_settings
from haustra.envs.learning.find import find_policy, policy_settings
from haustra.envs.learning.insertion import run_policy
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.runs.insertion import Insertion, Progress, run_insertion
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.errors import InvalidOptionError
from haustra.models.scene import Scene


def simulate(
    scene: Scene,
    *,
    driver: str = "follower",
    seconds: float = 60.0,
    steer: str = "pulls",
    seed: int = 0,
    progress: Progress | None = None,
) -> Insertion:
    """Let a driver insert the scope of a scene for up to `seconds` of simulated time.

    Scenes whose wall is a table of the lumen are stepped in linear time, the others by MuJoCo's CPU engine.

    Args:
        scene: colon and scope, from `haustra.models.scene.Scene.of` or `build_scene`.
        driver: 'follower', 'endoscopist', a TOML file of settings of one of them, the name of a policy that ships, or a
            policy's folder.
        seconds: longest run, in simulated time [s].
        steer: what bends the tip, 'pulls' or 'wheels'; a policy asks for pulls.
        seed: of the actions that a policy draws.
        progress: told now and then how far it is.

    Raises:
        InvalidOptionError: when there is no such driver, or it does not honour an option.
        UnsupportedSceneError: when what steps the scene cannot honour it.
    """
    policy = find_policy(driver)
    settings = settings_of(driver, policy, moves=scene.options.mesentery, steer=steer, seed=seed)
    own: dict[str, Any] = {"seconds": seconds, "settings": settings, "progress": progress}
    if policy is not None:
        return run_policy(scene, policy, **own)
    run = run_linear_insertion if scene.options.wall_law == "table" else run_insertion
    return run(scene, **own)


def settings_of(name: str, policy: MlpPolicy | None, *, moves: bool, steer: str = "pulls", seed: int = 0) -> Any:
    """Settings of a driver, for the record.

    Args:
        name: of the driver.
        policy: as `find_policy` gives it.
        moves: whether the colon moves on its mesentery.
        steer: what bends the tip, 'pulls' or 'wheels'.
        seed: of what a policy draws.

    Raises:
        InvalidOptionError: naming what the driver does not honour.
    """
    if policy is None:
        if seed:
            raise InvalidOptionError(f"The driver '{name}' draws nothing: leave the seed out.")
        return driver_settings(name, moves=moves, steer=steer)
    if steer != "pulls":
        raise InvalidOptionError("A policy asks for pulls of wires: leave wheels out, or let another driver drive.")
    return policy_settings(name, policy, seed=seed)
