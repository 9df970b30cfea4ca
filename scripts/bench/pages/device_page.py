"""The page and the picture of a device on the virtual bench."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.files import write_atomically

_LABELS = {
    "along_m": "along the tube from the handle [m]",
    "EI_N_cm2": "EI [N cm²]",
    "GJ_N_cm2_deg": "GJ [N cm²/degree]",
    "free_length_m": "free length [m]",
    "force_N": "force [N]",
    "angle_deg": "bend of the tip [degrees]",
    "knob_deg": "bend that the knob asks for [degrees]",
    "tip_deg": "bend of the tip [degrees]",
    "turned_deg": "bends behind the tip [degrees]",
    "friction": "friction between treads and wall [1]",
    "rpm": "speed of the worm [1/min]",
    "width_mm": "width of the lumen [mm]",
    "distance_m": "distance of the magnets [m]",
    "grip": "friction between balloon and wall [1]",
    "depth_m": "scope in a tube with a loop [m]",
    "push_N": "force of the hand [N]",
}
_TITLES = {
    "stiffness": "stiffness",
    "buckling": "buckling",
    "tip_force": "force of the tip, largest pull",
    "knob": "tip and knob, there and back",
    "growth": "force left for the tip",
    "friction": "propulsion",
    "speed": "propulsion",
    "width": "propulsion",
    "magnet": "pull in line",
    "anchor": "holding force of a balloon",
    "loop": "insertion through a loop",
}
_COLOURS = ("#2f6f8f", "#c2413b")


def device_page(name: str, found: Mapping[str, Any], *, command: str) -> str:
    """The figures as a page in Markdown."""
    rows = "\n".join(
        f"| {row['quantity']} | {shown(row['value'])} | {row['unit']} | {row['published']} |" for row in found["rows"]
    )
    return (
        f"# {name} on the virtual bench\n\nMade by `{command}`.\n\n![curves](bench.png)\n\n"
        f"| quantity | value | unit | published |\n|---|---|---|---|\n{rows}\n"
    )


def shown(value: float | str | None) -> str:
    """A value as a page shows it."""
    return "–" if value is None else value if isinstance(value, str) else f"{value:.3g}"


def draw_bench(path: Path, found: Mapping[str, Any]) -> Path:
    """Draw every curve into one PNG file.

    Raises:
        OutputError: when the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    curves = found["curves"]
    figure = Figure(figsize=(4.2 * max(len(curves), 1), 3.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axis, (name, curve) in zip(
        figure.subplots(1, max(len(curves), 1), squeeze=False)[0], curves.items(), strict=True
    ):
        across, *values = curve
        for number, value in enumerate(values):
            side = axis if number == 0 else axis.twinx()
            side.plot(curve[across], curve[value], color=_COLOURS[number])
            side.set_ylabel(_LABELS[value], color=_COLOURS[number])
            side.set_ylim(bottom=None if value == "tip_deg" else 0)
        axis.set_xlabel(_LABELS[across])
        axis.set_title(_TITLES[name])
        axis.grid(color="#dfe3e8")
    return write_atomically(path, lambda temporary: figure.savefig(temporary, format="png"))
