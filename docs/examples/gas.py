"""Gas: an insertion with insufflation, which sets how wide the lumen is.

The scope lets carbon dioxide in while the pressure at its tip is less than the set point; the colon opens by its
pressure-volume law.
"""

import matplotlib.pyplot as plt

import haustra

MMHG = 133.322  # Pa

colon = haustra.grow_colon(seed=4)
scene = haustra.Scene.of(colon, "adult", gas=25 * MMHG, gas_start=8 * MMHG)
run = haustra.simulate(scene, seconds=30)
print(f"{1e6 * run.gas.volume[-1]:.0f} mL of gas at the end")

figure, (left, right) = plt.subplots(1, 2, figsize=(6, 3), layout="constrained")
left.plot(run.trajectory.time, run.gas.pressure / MMHG)
left.set(xlabel="time [s]", ylabel="pressure of segments [mmHg]")
right.plot(run.trajectory.time, 1e6 * run.gas.volume)
right.set(xlabel="time [s]", ylabel="gas in the colon [mL]")
figure.savefig("gas.webp")
