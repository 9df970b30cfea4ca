"""Many scopes at once: a thousand worlds on a GPU where there is one, or thirty-two on the processor.

The same program steps both; a world's colon, friction and stiffness are its own. On a GPU actions and observations stay
there (`ScopeTask.in_place`).
"""

import time

import matplotlib.pyplot as plt
import numpy as np

from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import MissingDependencyError

config = TaskConfig(seeds=(0, 2), difficulty="easy", observation="state")
try:
    task = ScopeTask(config, worlds=1024, backend="linear-gpu")
except MissingDependencyError:
    task = ScopeTask(config, worlds=32, threads=2, backend="linear")
task.reset(seeds=list(range(task.worlds)))
push = np.tile([0.7, 0.0, 0.0, 0.0], (task.worlds, 1))
arcs, began = [], time.perf_counter()
for _ in range(100):
    arcs.append(task.step(push).info["tip_arc"])
rate = task.worlds * len(arcs) / (time.perf_counter() - began)
print(f"{task.worlds} scopes: {rate:.0f} steps of environments a second")

plt.figure(figsize=(6, 3), layout="constrained")
plt.plot(task.interval * np.arange(1, len(arcs) + 1), np.array(arcs)[:, :32], lw=0.8)
plt.xlabel("time [s]")
plt.ylabel("tips along their colons [m]")
plt.savefig("gpu_batch.webp")
task.close()
