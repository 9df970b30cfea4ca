"""Your own device: a TOML file of a capsule that is dragged half as much, beside the shipped one.

A design is data: each key is a field with a unit and a range, and nothing in the file is run. A new kind of device is a
folder of its own (docs/how-to/own-device.md).
"""

from pathlib import Path

import matplotlib.pyplot as plt

import haustra
from haustra.assets import asset

shipped = asset("devices/capsule.toml").read_text(encoding="utf-8")
Path("mine.toml").write_text(shipped.replace("[drag]\nvalue = 10.0", "[drag]\nvalue = 5.0"), encoding="utf-8")

colon = haustra.grow_colon(seed=5)
plt.figure(figsize=(6, 3), layout="constrained")
for name in ("capsule", "mine.toml"):
    run = haustra.run_device(haustra.load_device(name), colon, seconds=20)
    print(f"{name}: {run.outcome.value}, tip at {run.records['tip_arc'][-1]:.2f} m")
    plt.plot(run.records["time"], run.records["tip_arc"], label=name)
plt.xlabel("time [s]")
plt.ylabel("tip along the colon [m]")
plt.legend()
plt.savefig("own_device.webp")
