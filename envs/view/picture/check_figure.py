"""A picture of what was found about a colon: its shape, its radius along the way, and the places to look at."""

from pathlib import Path

import numpy as np

from haustra.files import write_atomically
from haustra.models.anatomy.check import Check
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.section import effective_diameter

COLOURS = ("#4c78a8", "#f58518", "#54a24b", "#b79a20", "#88548b", "#9d755d")
"""One for each segment."""
PROBLEM = "#d62728"
"""Colour of what needs attention."""
DRAWN_TRIANGLES = 12_000
"""Triangles of the shape that are drawn: more only take time."""


def write_check_figure(colon: Colon, check: Check, path: Path) -> Path:
    """Draw front and side view with problem spots, and diameters along the centreline, as PNG.

    Raises:
        OutputError: when the file cannot be written.
    """
    import matplotlib
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8.5), dpi=110)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.6, 1), hspace=0.22, wspace=0.12)
    for column, (axes, name) in enumerate((((0, 2), "front (patient's left at the right)"), ((1, 2), "side"))):
        _draw_shape(figure.add_subplot(grid[0, column]), colon, check, axes, name)
    _draw_profile(figure.add_subplot(grid[1, :]), colon, check)
    figure.suptitle(f"{colon.name}: {check.state}", x=0.02, ha="left", fontsize=13)
    with matplotlib.rc_context({"svg.hashsalt": "haustra"}):
        return write_atomically(path, lambda target: figure.savefig(target, bbox_inches="tight"))


def _draw_shape(ax, colon: Colon, check: Check, axes: tuple[int, int], name: str) -> None:
    line = colon.centreline
    pick = np.linspace(0, len(colon.lumen.faces) - 1, min(DRAWN_TRIANGLES, len(colon.lumen.faces))).astype(int)
    corners = colon.lumen.vertices[colon.lumen.faces[pick]].mean(1) * 1e3
    ax.scatter(corners[:, axes[0]], corners[:, axes[1]], s=2, color="#c9c4bf", linewidths=0, alpha=0.5)
    points = line.points[:, axes] * 1e3
    for colour, segment in zip(COLOURS, colon.segments, strict=False):
        part = (line.arc >= segment.start) & (line.arc <= segment.end)
        ax.plot(points[part, 0], points[part, 1], color=colour, lw=1.8, label=segment.name)
    for place in check.narrow:
        part = (line.arc >= place.start - 2e-3) & (line.arc <= place.end + 2e-3)
        ax.plot(points[part, 0], points[part, 1], color=PROBLEM, lw=5, alpha=0.8, solid_capstyle="round")
    for contact in check.contacts:
        ends = [int(np.searchsorted(line.arc, arc)) for arc in (contact.first, contact.second)]
        ax.plot(points[ends, 0], points[ends, 1], color=PROBLEM, lw=0.8, ls=":", marker="x", ms=4)
    ax.annotate("anus", points[0], fontsize=8)
    ax.set_aspect("equal")
    ax.set_title(name, fontsize=9)
    ax.tick_params(labelsize=7)
    ax.set_xlabel("mm", fontsize=8)


def _draw_profile(ax, colon: Colon, check: Check) -> None:
    arc = colon.centreline.arc
    diameter = effective_diameter(colon.centreline, colon.radius)
    ax.fill_between(arc, diameter * 1e3, color="#c9c4bf", alpha=0.5, label="of equal volume")
    ax.plot(arc, check.passage.diameter * 1e3, color="#222", lw=1, label="largest ball")
    ax.axhline(check.device_diameter * 1e3, color=PROBLEM, lw=1, ls="--", label="device")
    for place in check.narrow:
        ax.axvspan(place.start - 2e-3, place.end + 2e-3, color=PROBLEM, alpha=0.25)
    for contact in check.contacts:
        ax.plot([contact.first, contact.second], [0, 0], color=PROBLEM, marker="x", ls="", ms=5, clip_on=False)
    top = float(diameter.max()) * 1e3
    for colour, segment in zip(COLOURS, colon.segments, strict=False):
        ax.axvspan(segment.start, segment.end, ymin=0.97, color=colour)
        ax.text((segment.start + segment.end) / 2, top * 1.12, segment.name, fontsize=7, ha="center")
    ax.set_ylim(0, top * 1.25)
    ax.set_xlim(0, arc[-1])
    ax.set_xlabel("along the colon from the anus [m]; crosses: loops touch; red: too narrow", fontsize=8)
    ax.set_ylabel("diameter [mm]", fontsize=8)
    ax.tick_params(labelsize=7)
    ax.legend(fontsize=7, loc="upper left", bbox_to_anchor=(0, 0.9), ncols=3)
