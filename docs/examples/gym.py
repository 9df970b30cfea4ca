"""Gymnasium in thirty lines: an insertion driven by chance, what is paid for it, and what the tip sees.

Observations are what hand, scope and camera can measure; `info` holds the truth. Needs `pip install haustra[rl]`.
"""

import matplotlib.pyplot as plt

import haustra

env = haustra.make_env("Colonoscopy", seeds=(0, 1), difficulty="easy", mesentery=False, render_mode="rgb_array")
seen, info = env.reset(seed=0)
print({name: part.shape for name, part in seen.items()})
rewards, pictures = [], []
for step in range(240):
    if step % 12 == 0:
        action = env.action_space.sample()
        action[0] = abs(action[0])  # push on
    seen, reward, terminated, truncated, info = env.step(action)
    rewards.append(reward)
    if step % 80 == 79:
        pictures.append(env.render())
    if terminated or truncated:
        break
print(f"tip at {info['tip_arc']:.2f} m, wall force {info['wall_force']:.1f} N, paid {sum(rewards):.2f}")

figure, axes = plt.subplots(1, max(len(pictures), 2), figsize=(6, 2.2), layout="constrained")
for number, picture in enumerate(pictures):
    axes[number].imshow(picture)
    axes[number].set(title=f"after {80 * (number + 1)} steps", xticks=[], yticks=[])
figure.savefig("gym.webp")
env.close()
