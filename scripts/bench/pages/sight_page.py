"""The page of renderers beside exact rays and a path tracer, from what `haustra bench sight` kept.

`python -m haustra.scripts.bench.pages.sight_page sight-reference.json docs/validation/sight-reference.md` writes it.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.reading import read_document

_HEAD = """\
# What the tip sees, held to others

**Every renderer's distances stand beside MuJoCo's exact rays, and the shader's light beside a path tracer's.**

Made from docs/validation/data/sight-reference.json, which `haustra bench sight -o DIR` leaves; edit
`scripts/bench/pages/sight_page.py`, not this page. How renderers work stands in [what the tip sees](sight.md).

"""
_TAIL = """
What differs is the light alone. A matt wall is itself a model: mucosa is wet, and light goes some millimetres under it
before it comes back, which neither does here. Colours are assumed ([what is measured, calibrated,
assumed](sight.md#what-is-measured-calibrated-assumed)), and with a wall that is darker in red less would go from wall
to wall. So this tells what the shader leaves out of its own wall, not how far pictures are from a patient's.

Mitsuba has neither a calibrated fisheye nor such guides: its path tracer is asked along the project's rays, and the
guides are an emitter of its own (`scripts/bench/sight/mitsuba_light.py`), in variant `scalar_rgb`. In a matt sphere it
gives the light that theory says, r / (1 − r) of the mean direct light, by test. The scene is written without Mitsuba
(`traced_scene.py`), in millimetres before the camera, where single precision is finest.
"""


def sight_page(kept: Mapping[str, Any]) -> str:
    """The page as Markdown."""
    return _HEAD + "\n".join([*_depths(kept), "", *_reference(kept)]) + "\n" + _TAIL


def _depths(kept: Mapping[str, Any]) -> list[str]:
    about = kept["about"]
    lines = [
        "## Distances",
        "",
        f"From {about['worlds']} tips that the follower drove for {about['seconds']:g} s into colons 0 and 1,"
        f" {about['size']} × {about['size']} pixels, against MuJoCo's rays to the same triangles in one run. The wall"
        " is out of the tip's way; depth pictures see the colon as without the tip, in 255 steps of 0.47 mm but for"
        " numpy's. Pixels count where either distance is below 114 mm.",
        "",
        "| renderer | colons stand: median, 99 of 100; share within 1 mm | colons move |",
        "|---|---|---|",
    ]
    rows = {(row["renderer"], row["colons"]): row for row in kept["depths"]}
    for name in dict.fromkeys(row["renderer"] for row in kept["depths"]):
        found = (_distances(rows.get((name, colons))) for colons in ("stand", "move"))
        lines.append(f"| {name} | {' | '.join(found)} |")
    return lines


def _distances(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return "are not drawn"
    if "missing" in row:
        return "not measured: no GPU" if "NVIDIA" in row["missing"] else f"not measured: {row['missing']}"
    if row["p99_mm"] < 0.001:
        return f"below 0.001 mm; {_share(row['within_1_mm'])}"
    median = "below 0.001" if row["median_mm"] < 0.001 else f"{row['median_mm']:.2f}"
    return f"{median}, {row['p99_mm']:.2f} mm; {_share(row['within_1_mm'])}"


def _share(share: float) -> str:
    return f"{100 * share:.2f} %" if share < 1 else "all"


def _reference(kept: Mapping[str, Any]) -> list[str]:
    rows: Sequence[Mapping[str, Any]] = kept["reference"]
    if not rows:
        return ["Mitsuba was not installed."]

    def most(name: str) -> float:
        return max(row[name] for row in rows)

    lines = [
        "## Light",
        "",
        "The same triangles, normals, rays, guides and patterns of the wall in Mitsuba 3 (extra `mitsuba`), the wall"
        f" matt, {kept['about']['samples']} samples a pixel, in grown colon 5, a tip pressing the wall. Distances"
        f" are within {most('distance_largest_mm'):.4f} mm of Mitsuba's, normals within"
        f" {most('normals_largest_deg'):.4f}°, and where nothing shades, the guides' formula gives"
        f" Mitsuba's direct light to {1e7 * most('formula'):.1f} · 10⁻⁷ of it.",
        "",
        "![The shader's pictures, Mitsuba's, and their difference](../images/reference.webp)",
        "",
        "| linear light | " + " | ".join(row["place"] for row in rows) + " |",
        "|---|" + "---|" * len(rows),
    ]
    for title, name in _LIGHT.items():
        lines.append(f"| {title} | " + " | ".join(f"{100 * row[name]:.3g} %" for row in rows) + " |")
    left = [float(np.mean([row[f"from_wall_{band}"] for row in rows])) for band in ("red", "green", "blue")]
    lines += [
        "",
        "Differences are means of absolute differences, over Mitsuba's mean. What the shader leaves out is mostly light"
        f" that other wall has sent on: {100 * left[0]:.0f} % of the red that comes back, {100 * left[1]:.0f} % of the"
        f" green and {100 * left[2]:.0f} % of the blue. It reddens what is far off by a formula that was not fitted to"
        " this: its pictures are less red, and darker in the depth. Shadows take little, since guides stand beside the"
        " lens. From direct light the shader differs by the film of water's highlights, its softened edge of light and"
        " that reddening.",
    ]
    return lines


_LIGHT = {
    "pixels that some guide leaves in shadow": "in_shadow",
    "light that shadows take": "light_in_shadow",
    "shader against direct light": "shader_direct",
    "the same, each band made as bright": "shader_direct_exposed",
    "shader against light from wall to wall": "shader_traced",
    "likewise, each band made as bright": "shader_traced_exposed",
    "noise of the light from wall to wall, by halves of the samples": "traced_noise",
    "red light that comes from other wall": "from_wall_red",
    "green light that does": "from_wall_green",
    "blue light that does": "from_wall_blue",
}
"""Rows of the table, by their titles."""


if __name__ == "__main__":
    measured = read_document(Path(sys.argv[1]), "measurement")
    Path(sys.argv[2]).write_text(sight_page(measured), encoding="utf-8")
