"""The page and the pictures of injury in grown colons, from what `haustra bench injury` measured."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.view.picture.injury_map import injury_map
from haustra.files import write_atomically
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.injury.perforation import perforation_probability
from haustra.scripts.bench.injury import table

_HEAD = """\
# Validation: perforation, bleeding and pain

**Question.** How much harm do insertions do by laws from published tissue tests, and how far is that from patients?

Made by `haustra bench injury -o DIR`; edit `scripts/bench/pages/injury_page.py`, not this page.

**Perforation** is a distribution over people (`haustra.models.injury.perforation`). Median strength depends on the
shape of what presses, 14.1 N under a straight head and 46.5 N under one bent by 90 degrees (porcine, Johnson 2019),
25.6 N assumed under a head bent back and under the side of the shaft; times 1.5 for human over porcine tissue; half of
it, by assumption, grows with the device's diameter. One person's strength is that times one lognormal factor (CV 0.25),
so that P = Φ(ln r / σ) with r the largest force over median strength of all links and times. A run that ends as escaped
has torn everybody's colon: P = 1. Gas pressure counts alike, over 169 mmHg in the sigmoid to 81 mmHg in the caecum,
where it is given. **Nothing is calibrated to how often patients are harmed.**

**Bleeding** (`haustra.models.injury.bleeding`) is a place of two centimetres whose mucosa is sheared by more than
10 kPa, friction times force over the patch that a link lies on, or at which suction pulls by more than 40 kPa: the
pressure across mucosa that lies over the channel of a scope that sucks. Both thresholds (3–30 and 13–80 kPa) are
assumed: nobody published one. Suction is that of drives, in which a hand sucks with 60 kPa (27–85, assumed); a
driver's run lets gas in only. Episodes that are driven or recorded count shear at each action's end, and so do those of
learners where `TaskConfig.bleeding` asks for it, suction of their gas action too (`haustra.envs.tasks.blood`).

**Pain** (`haustra.models.injury.pain`) is the largest tension of wall or mesentery over that which hurts, 100 N/m for
both: of the wall by Laplace's law of balloons that hurt in the sigmoid (45–180 N/m), of the mesentery assumed (30–300).
A colon that is fixed in space has tension of its wall only, and so have segments that have grown to the back wall.

**Progression** is told from the imager's coils (`haustra.envs.runs.measure.progression`): own stand-ins for the
colonoscopy progression score and the five measures of 3D-CoPS, whose formulas are not public.

![P(perforation) of runs, and pain by site](../images/injury.png)

![Pain along the colon over time, and where the wall is likeliest torn](../images/injury-map.png)

"""
_TAIL = """
Patients: diagnostic perforation WJG 2010;16:425; pain by site and CoPS 58 patients, Scand J Gastroenterol 2018;53:345;
demands for drugs Shah 2002, Endoscopy 34:435.

## What this does not say

- The driver is the lumen follower with an adult scope, one design, friction 0.1. It pushes on where an endoscopist
  would stop, so P is that of the follower, not of patients; what moves it by how much stands in the rows above.
- Force counts on a contact of 25 mm of shaft, whatever length links have; what a longer link bears counts as a whole,
  which errs towards tears, and links of an adult scope's shaft are 49 mm. A straight head that lies with its side on
  the wall counts as pressing with its end, which errs so too.
- Strength and thresholds are the same in all segments but for gas; inflamed, thin and diseased walls are not modelled.
- Shear is bounded by friction times force. Mucosa lies over the channel where the wall, as the centreline sees it, is
  within 3.7 mm before the channel's mouth: not at the caecum's pole. How far suction draws it in, and for how long,
  does not count, and gas flows as if nothing lay there. Instruments pull at nothing but what they cut.
- Blood is drawn where and since a scope's wall bled, as far as a centimetre around the place next to the scope, or
  3.7 mm around that before the channel: in a run's last picture and film, in the console, in what is exported of
  drives and episodes, and in data sets. It does not flow, and nothing stops it. Pictures that a learner sees, and those
  of other devices, show none.
- Pain has no memory, no sedation and no person: thresholds are one number each.
"""
_MOVED, _FIXED = "#2f6f8f", "#c98a1b"


def injury_page(found: Mapping[str, Any]) -> str:
    """The page as Markdown."""
    rows = table(found["rows"])
    lines = [f"| {' | '.join(row)} |" for row in ([*rows[0]], ["---"] * len(rows[0]))]
    lines += [f"| {' | '.join(row.values())} |" for row in rows]
    seeds = [row["seed"] for row in found["rows"]]
    said = f"\nGrown colons {min(seeds)} to {max(seeds)}, {found['seconds']:g} s at most, backend linear.\n"
    return _HEAD + "\n".join(lines) + "\n" + said + _TAIL


def draw_injury(path: Path, found: Mapping[str, Any]) -> Path:
    """P(perforation) over load with the runs on it, and pain by site."""
    import matplotlib.pyplot as plt

    figure, (curve, sites) = plt.subplots(1, 2, figsize=(12.0, 4.0), layout="constrained")
    loads = np.linspace(0.3, 3.0, 300)
    curve.plot(loads, perforation_probability(loads), color="#30343b", lw=1)
    for moves, colour, label in ((True, _MOVED, "on the mesentery"), (False, _FIXED, "fixed")):
        rows = [row for row in found["rows"] if row["mesentery"] is moves]
        own = np.clip([row["load_peak"] for row in rows], 0.3, 3.0)
        curve.plot(own, [row["p_perforation"] for row in rows], "o", color=colour, label=label)
        values = [[row["pain_by_site"].get(name, 0.0) for row in rows] for name in SEGMENTS]
        places = np.arange(len(SEGMENTS)) + (-0.18 if moves else 0.18)
        sites.boxplot(
            values,
            positions=places,
            widths=0.3,
            whis=(0, 100),
            patch_artist=True,
            boxprops={"facecolor": colour},
            medianprops={"color": "black"},
        )
    curve.set(xlabel="largest force over median strength [1]", ylabel="P(perforation)", title="Perforation")
    curve.legend(frameon=False)
    sites.axhline(1.0, color="#c2413b", lw=1, ls="--")
    sites.set(ylabel="largest pain [1]", title="Pain by site")
    sites.set_xticks(range(len(SEGMENTS)), list(SEGMENTS), rotation=20)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=110, format="png"))
    plt.close(figure)
    return path


def draw_example(path: Path, found: Mapping[str, Any]) -> Path:
    """Pain along one colon over time."""
    own = found["example"]
    return injury_map(
        path,
        own["time"],
        own["arcs"],
        own["pain"],
        own["pressed"],
        segments=own["segments"],
        perforation_arc=own["perforation_arc_m"],
        p_perforation=own["p_perforation"],
    )
