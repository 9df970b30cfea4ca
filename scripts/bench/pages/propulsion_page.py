"""The validation page of the tracked robot, written from a study's own numbers."""

from typing import Any


def propulsion_page(result: dict[str, Any]) -> str:
    """The page as Markdown, from what `haustra propulsion --json` prints."""
    return "\n\n".join([_HEAD, _rows(result), _stresses(result), _full_range(result), _redesign(result)]) + "\n"


_HEAD = """# Validation: the tracked robot

**Question.** Does the model of the tracked robot pull, ripple and stress its tread as its papers say?

Made from docs/validation/data/tracked.json, which `haustra propulsion --json` prints; do not edit. What is modelled,
assumed and fitted is in [the theory](../theory/tracked.md). One number was fitted to a force: the indentation that
gives four tracks 3 N on tissue. Tooth, belt and tips are assumed, chosen so that ripple and stress ratio come out as
published; so those two columns show that a plausible tread explains the paper, and not that its tread is this one."""


def _rows(result: dict[str, Any]) -> str:
    header = (
        "| surface | mm/s | rpm | force, 4 tracks [N] | paper | ripple [N] | ripple / force | tooth passing [Hz] | "
        "normal a track [N] | F / (mu N) | worm torque [mN m] | force is |"
    )
    lines = ["## One track, times four", header, "|---" * 12 + "|"]
    for row in result["rows"]:
        cells = (
            row["surface"],
            f"{row['speed_mm_s']:.4g}",
            f"{row['rpm']:.0f}",
            f"{row['force_N']:.3f}",
            f"~{row['paper']['force_N']:g}",
            f"{row['ripple_N']:.3f}",
            f"{100 * row['ripple_fraction_per_track']:.1f} %",
            f"{row['ripple_Hz']:.2f}",
            f"{row['normal_per_track_N']:.3f}",
            f"{row['force_over_mu_normal']:.4f}",
            f"{1e3 * row['worm_torque_Nm']:.1f}",
            row["kind"],
        )
        lines.append("| " + " | ".join(cells) + " |")
    checks = result["checks"]
    lines += [
        "",
        f"Ratio of the surfaces {checks['surface_ratio']:.4f} (2 expected); spread over the speeds "
        f"{checks['spread_over_speeds_N']:.4f} N (paper: 0.15 N). The paper's ripple: about 0.2 N, 25 % of a "
        "track's force.",
    ]
    lines += ["", "![Force over speed](../images/tracked-force-over-speed.png)"]
    return "\n".join([lines[0], "", *lines[1:]])


def _stresses(result: dict[str, Any]) -> str:
    lines = [
        "## Tread stress [kPa]",
        "",
        "Mean von Mises stress of the belt within one tip radius of a tip, plane strain, at friction 0.4. 'Between' is "
        "the paper's levelled value, both ends of the tread at least 40 mm away.",
        "",
        "| where | high force: ours | paper | error | low force: ours | paper | error | low / high: ours | paper | "
        "error |",
        "|---" * 10 + "|",
    ]
    row = result["rows"][0]
    for where, ratio in result["checks"]["stress_low_over_high"].items():
        ours, paper = row[f"stress_{where}_kPa"], row["paper"][f"stress_{where}_kPa"]
        cells = [where]
        for state in ("high", "low"):
            error = 100 * (ours[state] / paper[state] - 1)
            cells += [f"{ours[state]:.1f}", f"{paper[state]:.1f}", f"{error:+.0f} %"]
        cells += [f"{ratio['ours']:.2f}", f"{ratio['paper']:.2f}", f"{ratio['error_percent']:+.0f} %"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _full_range(result: dict[str, Any]) -> str:
    block = result["full_range"]
    lines = [
        "## The whole device over the range of speeds",
        "",
        "| surface | rpm | force [N] | closed form | implied by the paper: mean (least-most) | roll [rad/s] "
        "| closed form |",
        "|---" * 7 + "|",
    ]
    for surface, found in block["surfaces"].items():
        bounds = zip(found["implied_mean_N"], found["implied_low_N"], found["implied_high_N"], strict=True)
        for point, (mean, low, high) in zip(found["curve"], bounds, strict=True):
            lines.append(
                f"| {surface} | {point['rpm']:.0f} | {point['force_N']:.3f} | {point['closed_form_N']:.3f} | "
                f"{mean:.2f} ({low:.2f}-{high:.2f}) | {point['roll_rad_s']:.3f} | "
                f"{point['closed_form_roll_rad_s']:.3f} |"
            )
    lines.append("")
    for surface, found in block["surfaces"].items():
        rmse = found["rmse"]
        lines.append(
            f"- {surface}: RMSE {rmse['median_percent']:.1f} % of the measured mean (median over all curves the paper "
            f"allows; {rmse['low_percent']:.1f} to {rmse['high_percent']:.1f} %, 95 % of them below "
            f"{rmse['p95_percent']:.1f} %). The bound of 12 % holds for {100 * rmse['within_12_percent_share']:.0f} % "
            "of those curves. No curve whatever could promise less than "
            f"{rmse['best_guaranteed_percent']:.1f} % against all of them. The paper's own: "
            f"{found['paper_rmse_percent']:.1f} %. Of the {100 * rmse['rising_ever_less_share']:.0f} % of those curves "
            "that rise to 150 rpm by less and less, as friction does that grows with a power of speed up to 1, all are "
            f"within {rmse['rising_ever_less_high_percent']:.1f} %. The farthest of all curves is "
            f"{', '.join(f'{value:.2f}' for value in rmse['farthest_curve_N'])} N."
        )
    bound = block["least_worst_percent"]
    lines += [
        "",
        "A power of speed up to 150 rpm and a linear fall beyond, the same on both surfaces, can keep to "
        f"{bound['peak_kept']:.1f} % against all curves where it has the published force at 150 rpm, and to "
        f"{bound['peak_free']:.1f} % where that is given up too "
        "(`haustra.models.devices.tracked.implied.least_worst`). So the bound of 12 % for all curves cannot be met "
        "with the published peak by losses of this form. The farthest curve stays level from 75 to 120 rpm, jumps to "
        "its peak, drops to 200 rpm and stays level again: the statements allow that; friction that grows with a power "
        "of speed does not.",
    ]
    fitted = ", ".join(f"{name.replace('_', ' ')} {value:.4g}" for name, value in block["fitted"].items())
    lines += [
        "",
        f"Fitted to {block['fitted_to']}: {fitted}. Misfit of the six, in percent of the mean: "
        f"{', '.join(f'{value:+.1f}' for value in block['misfit_percent'])}.",
        "",
        f"Identified: {'; '.join(block['identified'])}. Not identified: {'; '.join(block['not_identified'])}.",
    ]
    return "\n".join(lines)


def _redesign(result: dict[str, Any]) -> str:
    lines = [
        "## Least ripple at the same mean force",
        "",
        "| drive | starts | pitch [mm] | tip spacing [pitches] | [mm] | force [N] | fundamental | all harmonics, "
        "a track | four tracks |",
        "|---" * 9 + "|",
    ]
    for name in ("best", "same_pitch"):
        found = result["redesign"][name]
        lines.append(
            f"| {name.replace('_', ' ')} | {found['starts']} | {found['pitch_mm']:.3g} "
            f"| {found['spacing_pitches']:.2f} | {found['tip_spacing_mm']:.2f} | {found['force_N']:.3f} | "
            f"{100 * found['ripple_fraction_per_track']:.2f} % | {100 * found['all_harmonics_per_track']:.2f} % | "
            f"{100 * found['predicted_device']:.2f} % |"
        )
    lines += ["", "![Ripple over tip spacing, pitch and starts](../images/tracked-redesign.png)"]
    return "\n".join(lines)
