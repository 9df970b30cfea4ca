"""Stable-Baselines3: PPO on eight scopes at once, for as long as a coffee lasts.

A policy that drives well takes ten million steps and a GPU (`haustra train`); this shows how worlds are stepped in
linear time and handed to Stable-Baselines3. Needs `pip install haustra[rl]`.
"""

import matplotlib.pyplot as plt
import numpy as np
from stable_baselines3 import PPO

from haustra.envs.tasks.config import TaskConfig, Weights
from haustra.envs.tasks.sb3 import TaskVecEnv
from haustra.envs.tasks.scope_task import ScopeTask

config = TaskConfig(seeds=(0, 2), difficulty="easy", observation="state", weights=Weights(advance=100.0))
task = ScopeTask(config, worlds=8, threads=2, backend="linear")
model = PPO("MlpPolicy", TaskVecEnv(task), n_steps=128, batch_size=256, learning_rate=1e-3, seed=0)
means = []
for _ in range(8):
    model.learn(total_timesteps=8 * 128, reset_num_timesteps=False)
    means.append(np.mean(model.rollout_buffer.rewards))
    print(f"{model.num_timesteps} steps: {means[-1]:.3f} a step")
task.close()

plt.figure(figsize=(6, 3), layout="constrained")
plt.plot(8 * 128 * np.arange(1, len(means) + 1), means, "o-")
plt.xlabel("steps of all worlds")
plt.ylabel("mean reward of a step [1]")
plt.savefig("sb3.webp")
