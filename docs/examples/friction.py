"""Friction: the same run with four coefficients between scope and wall.

Friction is applied at the surface of the scope, by one law on every backend; `friction` is a field of `SceneOptions`,
as is everything else that a scene is made of.
"""

import matplotlib.pyplot as plt
import numpy as np

import haustra

colon = haustra.grow_colon(seed=2)
coefficients = (0.03, 0.1, 0.2, 0.4)
reached, pushed = [], []
for friction in coefficients:
    scene = haustra.Scene.of(colon, "adult", friction=friction)
    run = haustra.simulate(scene, seconds=40)
    reached.append(run.trajectory.tip_arc.max())
    pushed.append(np.abs(run.trajectory.push_force).mean())
    print(f"friction {friction}: tip at {reached[-1]:.2f} m, mean push {pushed[-1]:.1f} N")

figure, (left, right) = plt.subplots(1, 2, figsize=(6, 3), layout="constrained")
left.plot(coefficients, reached, "o-")
left.set(xlabel="friction [1]", ylabel="tip along the colon [m]", ylim=(0, None))
right.plot(coefficients, pushed, "o-")
right.set(xlabel="friction [1]", ylabel="mean push [N]", ylim=(0, None))
figure.savefig("friction.webp")
