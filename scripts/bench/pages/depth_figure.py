"""`python -m haustra.scripts.bench.pages.depth_figure PICTURE.png`.

What the tip's camera shows, and how far away that is.
"""

import sys
from pathlib import Path

import numpy as np

_COLONS = 4
_SIZE = 240


def draw(path: Path) -> Path:
    """Colour above, depth below, a third of the way into each of some grown colons."""
    import matplotlib.pyplot as plt

    from haustra.envs.tasks.bank import grown_bank
    from haustra.envs.tasks.pictures import Pictures
    from haustra.envs.tasks.sight import RANGE, Sight
    from haustra.files import write_atomically
    from haustra.models.devices.scope.library import named_design

    design = named_design("adult")
    bank = grown_bank(range(_COLONS), design)
    pictures = Pictures(bank, Sight(bank.cases), design.tip.field_of_view_deg)
    numbers = np.arange(_COLONS)
    stations = [len(case.points) // 3 for case in bank.cases]
    place, frame = (
        np.array([getattr(case, name)[at] for case, at in zip(bank.cases, stations, strict=True)])
        for name in ("points", "frames")
    )
    arc = np.array([at * case.step for case, at in zip(bank.cases, stations, strict=True)])
    depth = pictures.depth(numbers, place, frame, arc, _SIZE) * 1e3
    figure, axes = plt.subplots(2, _COLONS, figsize=(2.2 * _COLONS + 0.8, 4.6), layout="constrained")
    for case in numbers:
        axes[0, case].imshow(pictures.colour(int(case), (place[case], frame[case]), float(arc[case]), _SIZE))
        axes[0, case].set_title(f"grown {case}, {arc[case]:.2f} m in", fontsize=9)
        axes[1, case].imshow(np.where(depth[case] > 0, depth[case], np.nan), vmin=0, vmax=RANGE * 1e3)
    for axis in axes.flat:
        axis.set_axis_off()
    figure.colorbar(axes[1, 0].images[0], ax=axes[1], label="distance to the wall [mm]", shrink=0.9)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=100))
    plt.close(figure)
    return path


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
