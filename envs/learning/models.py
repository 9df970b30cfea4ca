"""Models of Stable-Baselines3 from a training's numbers, and the plain policy in them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from haustra.envs.learning.demonstrations import clone, load_demonstrations
from haustra.envs.learning.imitate import imitate
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.learning.schedule import LEAST_DEVIATION
from haustra.envs.learning.settings import Training
from haustra.envs.tasks.actions import ACTIONS
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import UnsupportedSceneError


def normalised(training: Training, worlds: VecEnv) -> Any:
    """The worlds as a `VecNormalize`: observations and rewards over their running deviation, or None."""
    if not training.normalise:
        return None
    # Observations are bounded, so that they need no clipping, which plain layers could not take over.
    return VecNormalize(worlds, gamma=training.gamma, epsilon=LEAST_DEVIATION**2, clip_obs=np.inf)


def build_model(training: Training, worlds: VecEnv, log: Path | None) -> Any:
    """An untrained model.

    Raises:
        UnsupportedSceneError: when PyTorch finds no GPU and the training wants one.
    """
    if training.device == "cuda" and not torch.cuda.is_available():
        raise UnsupportedSceneError("PyTorch finds no GPU: use --device cpu, or install PyTorch with CUDA.")
    common: dict[str, Any] = {
        "learning_rate": training.learning_rate,
        "gamma": training.gamma,
        "batch_size": training.batch,
        "seed": training.seed,
        "device": training.device,
        "tensorboard_log": str(log) if log else None,
    }
    layers = list(training.layers)
    if training.algorithm == "sac":
        return SAC(
            "MlpPolicy",
            worlds,
            buffer_size=training.buffer,
            train_freq=1,
            gradient_steps=2,
            learning_starts=20 * training.worlds,
            policy_kwargs={"net_arch": layers},
            **common,
        )
    model: Any = PPO(
        "MlpPolicy",
        worlds,
        n_steps=training.rollout,
        n_epochs=training.epochs,
        ent_coef=training.entropy,
        target_kl=training.target_kl,
        policy_kwargs={"net_arch": {"pi": layers, "vf": layers}, "log_std_init": training.log_std},
        **common,
    )
    if training.first_push:
        with torch.no_grad():
            model.policy.action_net.bias[ACTIONS.index("push")] = training.first_push
    return model


def policy_of(model: Any, training: Training, about: dict[str, Any], worlds: Any = None) -> MlpPolicy:
    """The deterministic policy of a model of Stable-Baselines3, as plain layers that read bare observations."""
    if training.algorithm == "ppo":
        parts = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    else:
        parts = [*model.actor.latent_pi, model.actor.mu]
    layers = [part for part in parts if isinstance(part, torch.nn.Linear)]
    weights = [layer.weight.detach().cpu().numpy().copy() for layer in layers]
    biases = [layer.bias.detach().cpu().numpy().copy() for layer in layers]
    if worlds is not None:
        scaled = weights[0] / np.sqrt(worlds.obs_rms.var + worlds.epsilon)
        biases[0] = (biases[0] - scaled @ worlds.obs_rms.mean).astype(np.float32)
        weights[0] = scaled.astype(np.float32)
    return MlpPolicy(
        weights=tuple(weights),
        biases=tuple(biases),
        activation="tanh" if training.algorithm == "ppo" else "relu",
        squashed=training.algorithm == "sac",
        config=training.task_then,
        drives=training.drives,
        about=about,
        deviation=model.policy.log_std.detach().exp().cpu().numpy() if training.algorithm == "ppo" else None,
    )


def warm_up(
    model: Any, training: Training, task: ScopeTask | DeviceTask, progress: Any, late: Callable[[], bool]
) -> None:
    """Learn from who drives by rule, until it is late, or from demonstrations, before learning from reward."""
    device = model.device
    if training.algorithm == "ppo":
        policy = model.policy

        def mean(seen: torch.Tensor) -> torch.Tensor:
            return policy.action_net(policy.mlp_extractor.forward_actor(seen.to(device))).cpu()

        parameters = [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters()]
    else:
        actor = model.actor

        def mean(seen: torch.Tensor) -> torch.Tensor:
            return torch.tanh(actor.mu(actor.latent_pi(seen.to(device)))).cpu()

        parameters = [*actor.latent_pi.parameters(), *actor.mu.parameters()]
    if training.demonstrations is not None:
        shown = load_demonstrations(Path(training.demonstrations), training.task)

        def tell(done: int, loss: float) -> None:
            progress(0, f"learning from {shown.episodes} demonstrations: {done} rounds, error {loss:.3f}")

        clone(mean, parameters, shown, seed=training.seed, progress=tell)
        return

    def tell_steps(done: int, loss: float) -> None:
        error = "" if np.isnan(loss) else f", error {loss:.3f}"
        progress(0, f"learning from who drives by rule: {done} steps{error}")

    about: dict[str, Any] = {"steps": training.imitate, "seed": training.seed}
    imitate(mean, parameters, task, **about, progress=tell_steps, late=late)


def hold_actor(model: Any, training: Training, leg: int) -> None:
    """In the first leg after imitation only PPO's critic learns: a critic that knows nothing unteaches the policy."""
    if training.algorithm != "ppo":
        return
    policy = model.policy
    held = bool(training.imitate or training.demonstrations) and leg == 0 and training.steps > training.leg
    for part in (*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std):
        part.requires_grad_(not held)
