"""Pictures of the propulsion study."""

from pathlib import Path
from typing import Any

_COLOURS = {"tissue": "#b5473c", "plastic": "#3b6ea5"}


def draw(folder: Path, design, result: dict[str, Any]) -> list[Path]:
    """Draw what the result holds; returns the files."""
    written = [_force_over_speed(folder / "force_over_speed.png", result)]
    if "redesign" in result:
        written.append(_redesign(folder / "redesign.png", design, result))
    return written


def _force_over_speed(path: Path, result: dict[str, Any]) -> Path:
    """Like the paper's figures 5 and 10: simulated track x 4, the device with losses, and what the paper implies."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
    for surface, colour in _COLOURS.items():
        rows = [row for row in result["rows"] if row["surface"] == surface]
        rpm = [row["rpm"] for row in rows]
        label = f"{surface} (friction {rows[0]['friction']:g})"
        axes.plot(rpm, [row["force_N"] for row in rows], "s--", color=colour, label=f"{label}: one track x 4")
        if "full_range" not in result:
            continue
        block = result["full_range"]["surfaces"][surface]
        speeds = [point["rpm"] for point in block["curve"]]
        forces = [point["force_N"] for point in block["curve"]]
        axes.plot(speeds, forces, "o-", color=colour, label=f"{label}: whole device with losses")
        axes.fill_between(
            speeds,
            block["implied_low_N"],
            block["implied_high_N"],
            color=colour,
            alpha=0.15,
            lw=0,
            label=f"{label}: measured, all that the paper allows",
        )
    axes.set(xlabel="worm speed [rpm]", ylabel="propulsion force, four tracks [N]", ylim=(0, None))
    axes.legend(fontsize=7.5, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.13), frameon=False)
    axes.grid(alpha=0.3)
    return _save(figure, path)


def _redesign(path: Path, design, result: dict[str, Any]) -> Path:
    """Ripple over tip spacing for each pitch, of a track and of the device, at the same mean force."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained", sharey=True)
    rows = result["redesign"]["candidates"]
    for number, starts in enumerate(sorted({row["starts"] for row in rows})):
        chosen = [row for row in rows if row["starts"] == starts]
        spacing = [row["spacing_pitches"] for row in chosen]
        label = f"pitch {chosen[0]['pitch_mm']:.3g} mm, {starts} start{'s' if starts > 1 else ''}"
        for axes, key in ((left, "track_ripple"), (right, "device_ripple")):
            axes.plot(spacing, [100 * row[key] for row in chosen], color=f"C{number}", label=label)
    now = design.tread.spacing_in_pitches
    for axes, title in ((left, "one track"), (right, "four tracks, teeth set apart by the worm")):
        axes.axvline(now, color="0.5", ls=":", lw=1)
        axes.set(xlabel="tip spacing [pitches]", title=title)
        axes.grid(alpha=0.3)
    left.annotate("paper's design", (now, 5), rotation=90, va="bottom", ha="right", color="0.4", fontsize=8)
    best = result["redesign"]["best"]
    left.plot(best["spacing_pitches"], 100 * best["all_harmonics_per_track"], "k*", ms=12, label="best, simulated")
    left.set(ylabel="ripple, all harmonics [% of mean force]", ylim=(0, None))
    right.legend(*left.get_legend_handles_labels(), fontsize=8)
    return _save(figure, path)


def _save(figure, path: Path) -> Path:
    import matplotlib.pyplot as plt

    from haustra.files import write_atomically

    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=140))
    plt.close(figure)
    return path
