"""`python -m haustra.scripts.bench.pages.worlds_figure BENCH.json PICTURE.png`.

Rate over worlds, as `bench worlds` found it.
"""

import json
import sys
from pathlib import Path
from typing import Any

_COLOURS = ("#2f5d8a", "#c9731b", "#4b8b4b", "#8a5cb8")


def draw(path: Path, found: dict[str, Any]) -> Path:
    """Steps per second over worlds, one line for each number of devices."""
    import matplotlib.pyplot as plt

    from haustra.files import write_atomically

    figure, axis = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
    shares = sorted({rate["devices"] for rate in found["rates"]})
    for share, colour in zip(shares, _COLOURS, strict=False):
        rows = [rate for rate in found["rates"] if rate["devices"] == share]
        worlds = [rate["worlds"] for rate in rows]
        label = f"{share} × {found['device']['kind']}"
        axis.loglog(worlds, [rate["steps_per_s"] for rate in rows], "o-", color=colour, label=label)
        axis.annotate(
            f"{rows[-1]['steps_per_s'] / 1e6:.1f} M",
            (worlds[-1], rows[-1]["steps_per_s"]),
            (6, -3),
            textcoords="offset points",
            color=colour,
        )
    axis.axhline(2e6, color="#888888", lw=0.8, ls="--")
    axis.set(
        xlabel="worlds",
        ylabel="steps per second, all worlds",
        title=f"A scope of {found['dofs']} dofs in a full colon, {found['timestep_s'] * 1e3:g} ms steps",
    )
    axis.grid(alpha=0.3, which="both")
    axis.legend(frameon=False)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=110))
    plt.close(figure)
    return path


if __name__ == "__main__":
    draw(Path(sys.argv[2]), json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
