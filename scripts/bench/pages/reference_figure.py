"""The figure of pictures beside a path tracer's: shader, direct light alone, light from wall to wall, differences.

`haustra bench sight -o DIR` leaves it as `reference.webp`.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.envs.view.picture.light import Response
from haustra.files import write_atomically
from haustra.scripts.bench.sight.reference import Compared

_TITLES = (
    "haustra's shader",
    "Mitsuba, matt wall,\nlight straight from the guides",
    "Mitsuba, matt wall,\nlight from wall to wall too",
    "shader less wall to wall,\nover the mean, equally exposed",
)


def draw_reference(path: Path, found: Sequence[tuple[str, Compared]]) -> Path:
    """Draw a row of pictures for each place.

    Args:
        path: of the WebP file.
        found: names of places, and what was seen there.

    Raises:
        OutputError: when the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 2.9 * len(found) + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    norm = Normalize(-2, 2)
    panels = figure.subplots(len(found), 4, squeeze=False)
    for row, (name, each) in zip(panels, found, strict=True):
        shape = each.view.own.shape
        for axes, light in zip(row, (each.shader, each.direct, each.traced), strict=False):
            axes.imshow(exposed(light.reshape(*shape, 3)))
        both = each.both
        bright, other = (light.mean(axis=1) for light in (each.shader, each.traced))
        apart = np.full(both.shape, np.nan)
        apart[both] = bright[both] / bright[both].mean() - other[both] / other[both].mean()
        row[3].imshow(apart.reshape(shape), cmap="RdBu_r", norm=norm)
        row[0].set_ylabel(name)
    for axes, title in zip(panels[0], _TITLES, strict=True):
        axes.set_title(title, fontsize=9)
    for axes in panels.ravel():
        axes.set_xticks([])
        axes.set_yticks([])
    figure.colorbar(ScalarMappable(norm, "RdBu_r"), ax=panels[:, 3].tolist(), shrink=0.8)
    quality = {"quality": 85}
    return write_atomically(
        path, lambda temporary: figure.savefig(temporary, dpi=80, format="webp", pil_kwargs=quality)
    )


def exposed(light: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width 3"]:
    """A picture of light, as the camera exposes it by itself."""
    camera = Response()
    return np.minimum(camera.gain_for(light) * light, 1.0) ** (1 / camera.gamma)
