"""Two scopes in one colon: how far each comes, and what it takes.

Both are driven by the lumen follower in a colon that moves on its mesentery. A single colon says little about two
designs: `haustra compare` takes many patients and gives intervals.
"""

import matplotlib.pyplot as plt

import haustra

colon = haustra.grow_colon(seed=1)
plt.figure(figsize=(6, 3), layout="constrained")
for name in ("adult", "paediatric-long"):
    scene = haustra.Scene.of(colon, name)
    run = haustra.simulate(scene, seconds=60)
    scores = haustra.score(scene, run)
    print(f"{name}: {scores['outcome']} in the {scores['tip_segment_max']}, hand {scores['push_force_peak_N']:.0f} N")
    plt.plot(run.trajectory.time, run.trajectory.tip_arc, label=name)
plt.xlabel("time [s]")
plt.ylabel("tip along the colon [m]")
plt.legend()
plt.savefig("two_scopes.webp")
