"""Pictures of the finite-element reference, after the paper's figures 6 to 9."""

from pathlib import Path
from typing import Any


def draw(folder: Path, geometry, result: dict[str, Any], indentation: float, friction: float) -> list[Path]:
    """Draw what was solved; returns the files. Solves two states more for the map of stress."""
    written = []
    if "table" in result:
        written.append(_table(folder / "force_indentation_phase.png", result["table"]))
    if "two-tips" in result:
        written.append(_two_tips(folder / "two_tips.png", result["two-tips"]))
        written.append(_stress_map(folder / "stress_map.png", geometry, result["two-tips"], indentation, friction))
    if "passage" in result:
        written.append(_passage(folder / "passage.png", result["passage"]))
    return written


def _table(path: Path, rows: list[dict]) -> Path:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for number, phase in enumerate(sorted({row["phase"] for row in rows})):
        chosen = [row for row in rows if row["phase"] == phase]
        x, y = [row["indentation_mm"] for row in chosen], [row["contact_N"] for row in chosen]
        axes.plot(x, y, ".-", color=plt.get_cmap("twilight")(number / 8), label=f"phase {phase:.3g}")
    axes.set(xlabel="indentation [mm]", ylabel="normal force of one tip [N]", xlim=(0, None), ylim=(0, None))
    axes.legend(fontsize=8, title="0 tooth, 0.5 gap", title_fontsize=8)
    axes.grid(alpha=0.3)
    return _save(figure, path)


def _two_tips(path: Path, rows: list[dict]) -> Path:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    for spacing in sorted({row["spacing_pitches"] for row in rows}):
        chosen = [row for row in rows if row["spacing_pitches"] == spacing]
        chosen = [*chosen, chosen[0] | {"phase": 1.0}]
        x, y = [row["phase"] for row in chosen], [row["contact_N"] for row in chosen]
        axes.plot(x, y, "o-", label=f"tips {spacing:g} pitches apart")
    axes.set(xlabel="tooth phase of the rear tip [pitches]", ylabel="normal force of a track [N]", ylim=(0, None))
    axes.legend()
    axes.grid(alpha=0.3)
    return _save(figure, path)


def _passage(path: Path, rows: list[dict]) -> Path:
    """The paper's figures 7 (force), 8 and 9 (stress above each tip)."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 1, figsize=(7, 7), layout="constrained", sharex=True)
    moved = [row["moved_mm"] for row in rows]
    axes[0].plot(moved, [row["contact_N"] for row in rows], "o-", ms=3, color="0.2")
    axes[0].set(ylabel="normal force\nof the track [N]", ylim=(0, None))
    for axis, tip in ((axes[1], "rear"), (axes[2], "front")):
        axis.plot(moved, [row[f"stress_{tip}_kPa"] for row in rows], "o-", ms=3, color="#b5473c")
        axis.set(ylabel=f"belt stress above\nthe {tip} tip [kPa]", ylim=(0, None))
    axes[2].set_xlabel("tread moved [mm]")
    for axis in axes:
        axis.grid(alpha=0.3)
    return _save(figure, path)


def _stress_map(path: Path, geometry, rows: list[dict], indentation: float, friction: float) -> Path:
    """The paper's figure 6: von Mises stress in the high- and the low-force state."""
    import matplotlib.pyplot as plt
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import Normalize
    from matplotlib.patches import Circle

    from haustra.models.devices.tracked.fem.strip import Strip
    from haustra.models.devices.tracked.fem.study import von_mises

    strip = Strip.build(geometry, span=geometry.tip_spacing + geometry.pitch)
    first = [row for row in rows if row["spacing_pitches"] == rows[0]["spacing_pitches"]]
    states = {"high": max(first, key=lambda row: row["contact_N"]), "low": min(first, key=lambda r: r["contact_N"])}
    figure, axes = plt.subplots(2, 1, figsize=(9, 5.2), layout="constrained", sharex=True)
    scale = plt.cm.ScalarMappable(Normalize(0, 150), "turbo")
    for axis, (name, row) in zip(axes, states.items(), strict=True):
        rear = -round(geometry.tip_spacing / 2 / geometry.pitch) * geometry.pitch + row["phase"] * geometry.pitch
        tips = [rear, rear + geometry.tip_spacing]
        state = strip.press(tips, indentation, friction=friction)
        tread, tissue = von_mises(strip, state)
        x = (strip.positions + state.displacement) * 1e3
        offset = len(strip.tread.nodes)
        for quads, stress in ((strip.tissue.quads + offset, tissue), (strip.tread.quads, tread)):
            colours = scale.to_rgba(stress / 1e3)
            axis.add_collection(PolyCollection(list(x[quads]), facecolors=colours, edgecolors=colours, lw=0.1))
        height = (geometry.clearance + indentation - geometry.tooth_height - geometry.belt_thickness) * 1e3
        for tip in tips:
            radius = geometry.tip_radius * 1e3
            axis.add_patch(Circle((tip * 1e3, height - radius), radius, color="0.6"))
        axis.set(
            xlim=(tips[0] * 1e3 - 14, tips[1] * 1e3 + 14),
            ylim=(height - 4.5, 10),
            aspect="equal",
            ylabel="[mm]",
            title=f"{name}-force state: {row['contact_N']:.2f} N",
        )
    axes[1].set_xlabel("along the track [mm]; the tread moves to the left")
    figure.colorbar(scale, ax=axes, label="von Mises stress [kPa]", extend="max")
    return _save(figure, path)


def _save(figure, path: Path) -> Path:
    import matplotlib.pyplot as plt

    from haustra.files import write_atomically

    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=140))
    plt.close(figure)
    return path
