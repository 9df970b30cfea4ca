"""What is measured of a colon to compare it with published anatomy."""

import numpy as np
from scipy.signal import find_peaks

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.frames import arc_length, resample, smooth
from haustra.models.anatomy.properties import Clearance
from haustra.models.anatomy.repair import signed_volume
from haustra.models.anatomy.section import effective_diameter
from haustra.models.anatomy.tortuosity import acute_flexures, arc_over_chord

FOLD_PROMINENCE = 1.5e-3
"""A fold narrows the effective diameter by this much [m]; as in the measurements on the open models."""
SMOOTHING = 8e-3
"""Standard deviation by which a centreline is smoothed before its length and turns are compared [m]: published CT
centrelines wiggle."""


def anatomy_of(colon: Colon) -> dict[str, float]:
    """Lengths, diameters, folds and tortuosity as flat names with units, 'sigmoid.length_m' and the like."""
    line = colon.centreline
    step = float(line.arc[1])
    diameter = effective_diameter(line, colon.radius)
    clear = Clearance(colon.lumen)(line.points)
    smoothed = smooth(resample(line.points, step), SMOOTHING / step)
    volume = signed_volume(colon.lumen.vertices, colon.lumen.faces)
    found: dict[str, float] = {
        "total.length_m": line.length,
        "total.smoothed_length_m": float(arc_length(smoothed)[-1]),
        "total.volume_m3": volume,
        "total.volume_per_length_m2": volume / line.length,
        "total.flexures": float(acute_flexures(line.points)),
        "total.flexures_per_m": acute_flexures(line.points) / line.length,
    }
    spans = {segment.name: (segment.start, segment.end) for segment in colon.segments}
    spans["rectosigmoid"] = (spans["rectum"][0], spans["sigmoid"][1])
    for name, (start, end) in spans.items():
        inside = (line.arc >= start) & (line.arc <= end)
        wide = diameter[inside]
        found |= {
            f"{name}.length_m": end - start,
            f"{name}.diameter_m": float(wide.mean()),
            f"{name}.diameter_sd_m": float(wide.std()),
            f"{name}.inscribed_share": float(2 * clear[inside].mean() / wide.mean()),
            f"{name}.arc_over_chord": arc_over_chord(line.points[inside]),
        }
        folds = find_peaks(-wide, prominence=FOLD_PROMINENCE)[0]
        if len(folds) > 2:
            found[f"{name}.fold_spacing_m"] = float(np.diff(folds).mean() * step)
    return found
