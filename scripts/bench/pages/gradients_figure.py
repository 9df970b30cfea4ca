"""`python -m haustra.scripts.bench.pages.gradients_figure FOUND.json PICTURE.png`: what `bench gradients` found."""

import json
import sys
from pathlib import Path
from typing import Any

from haustra.scripts.bench.stiffness_profile import BEHIND, ZONES

_KINDS = {"fixed": "fixed colons", "mesentery": "colons on their mesentery"}
_TICKS = 0.3, 0.5, 1.0, 2.0, 3.0
_GRADIENT, _OTHERS = "#c9731b", "#2f5d8a"


def draw(found: dict[str, Any], path: Path) -> Path:
    """Searches over time, the profiles that they found, and how far derivatives are off secants until when."""
    import matplotlib.pyplot as plt
    import numpy as np

    from haustra.files import write_atomically

    figure, axes = plt.subplots(2, 3, figsize=(12, 6.4), layout="constrained")
    edges = np.linspace(*BEHIND, ZONES + 1)
    for (kind, title), (search, profile, horizon) in zip(_KINDS.items(), axes, strict=True):
        for number, each in enumerate(found[kind]["search"]):
            first = number == 0
            style = {"color": _GRADIENT if first else _OTHERS, "lw": 2.2 if first else 1.0, "zorder": 3 - (not first)}
            label = "gradient" if first else "Optuna, each seed" if number == 1 else None
            search.step(each["seconds"], each["best"], where="post", label=label, **style)
            profile.stairs(each["profile"], edges * 1e3, baseline=None, **style)
        search.set(xlabel="processor time, s", ylabel="best objective so far, N", title=title)
        search.legend(frameon=False)
        profile.axhline(1.0, color="#888888", lw=0.8, ls="--")
        profile.set(xlabel="behind the tip, mm", ylabel="EI over the design's", yscale="log", title="best profiles")
        profile.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS], minor=False)
        profile.minorticks_off()
        rows = found[kind]["horizon"]
        until = [row["seconds"] for row in rows]
        lines = {
            "off_median": "of a world, median",
            "off_mean": "averaged",
            "off_mean_held_back": "held back, averaged",
        }
        for (name, label), colour in zip(lines.items(), ("#888888", _OTHERS, _GRADIENT), strict=True):
            horizon.semilogy(until, [row[name] for row in rows], "o-", color=colour, label=label)
        horizon.axhline(1.0, color="#888888", lw=0.8, ls="--")
        horizon.set(xlabel="insertion until, s", ylabel="off the secant over ±10 %", title="derivatives")
        horizon.legend(frameon=False)
    for axis in axes.flat:
        axis.grid(alpha=0.3, which="both")
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=100))
    plt.close(figure)
    return path


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
