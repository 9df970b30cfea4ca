"""The page and the picture of gas in grown colons, from what `haustra bench gas` measured."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.files import write_atomically
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.law import MMHG, open_share
from haustra.models.gas.numbers import gas_numbers

_HEAD = """\
# Validation: gas in the colon

**Question.** Does gas open grown colons as it opens people's, and does the model neither lose nor make any?

Made from docs/validation/data/gas.json, which `haustra bench gas -o DIR` leaves; edit
`scripts/bench/pages/gas_page.py`, not this page.

**The law.** A segment holds V = Vmax exp(−κ p^−β) (`haustra.models.gas.law`), the power exponential that Bharucha
fitted to barostat curves: hardly anything opens below 8 mmHg, half at 12 to 18 mmHg, and little more beyond 40.
`haustra colon grow` and `haustra colon import --insufflate` use it; the diameters of grown colons are those at 25 mmHg.

**The compartments.** Gas is counted at standard pressure in six segments and in the small bowel behind the ileocaecal
valve (`haustra.models.gas.compartments`). It comes and goes through the scope at the tip's place, leaks at the anus,
passes the ileocaecal valve of 78 % of people and is absorbed. A collapsed segment, one with less than 15 % of its
volume, lets nothing through until its neighbour's pressure opens it.

![The law by segment, segments that are collapsed, and pressures of a slow insufflation](../images/gas.png)

"""
_TAIL = """
Published: volume per length Patrick and Pickhardt 2015 (n = 150), compliance Odunsi 2010 (n = 72), collapse and reflux
McLaughlin 2013 (38 of 108), pressures of colonoscopies a study of 34, volumes supine Pickhardt's group (n = 146). At
laparotomy colons were 114 cm long in the West and 111 cm in the East (Saunders 1995, 118 patients, without the distal
rectum; these lengths from memory, unverified), in CT 190 cm (Khashab 2009) and 150 cm (Utano 2021).

## What is calibrated, chosen and left out

- **Calibrated**: the factor on all diameters of grown colons, on the volume per length; what presses on segments, on
  the share of people with a collapsed one; the leak, on 0.25 L/min at 25 mmHg. That these three agree is therefore no
  evidence. Which segment collapses, and pressures in people with other colons, follow.
- **Chosen**: β, pressures by segment within 12–18 mmHg, absorption, the ileocaecal valve ([numbers](../numbers.md)).
- **Collapse** is counted where every segment has come to the set point, as after gas has gone round; insufflated from
  the anus, what lies behind a closed segment stays closed too.
- **Less gas is kept** than published of people with reflux, 3.4 L, whose small bowel takes more than 0.2 L.
- **Left out**: hysteresis and creep of the wall, tone that comes and goes, posture, and a scope that holds a
  segment open or stops its valve.
"""

_RUNS = """
## In runs

`haustra run --insufflate 25mmHg` (`gas` of a scene's options) lets gas in at the tip, 0.25 L/min, while the pressure
there is less than that, from a colon filled to `gas_start` on. The pressure of each segment sets the radius of the
wall's table (`haustra.models.wall.lumen_table.put_distended`); the tension of the wall adds 2π p r / ln(r / a) to its
stiffness, by the tip's segment for the whole scope. Pressures count in P(perforation) and pain; the highest is
`gas_pressure_peak_mmHg`, the colon's gas at the end `gas_volume_mL`. A lumen narrower than the device gives way: only
tissue holds it closed.

Gas moves the wall without inertia, so that its work is what the wall stores and what it does to a device that presses:
force times the wall's way, to 10⁻⁸.

**Gas holds a colon out.** Gas of pressure p thrusts the ends of a tube of cross-section A apart by p A, on average
0.5 N at 10 mmHg and 4 N at 25. A colon that was imaged was in balance with that, so one whose gas has less draws
together by what it has lost, against its folds and what holds it (`haustra.models.wall.moving_colon.gas_thrust`, one
law for both backends; how much a colon has lost is the mean over its segments,
`haustra.models.gas.compartments.pressure_lost`). Nothing of it was fitted: that virtual patients' colons are as much
shorter without gas as at laparotomy, above, follows. A colon that begins with less gas than it was imaged with draws
together at the start.

Backends `linear`, on a CPU, and `native`, of one scope, honour it against the table; the others refuse it, and so do
derivatives, trained policies in single runs, pictures and depth of episodes, and recordings of evaluations.

An adult scope in grown seed 0 on its mesentery, driven by the follower, filled to the set point at the start:

"""


_WATER = """
## Water

`haustra run --insufflate 10mmHg --water 300mL` (`water` of a scene's options) puts water into rectum and sigmoid at the
start; the console's hand pours it in at the tip, 0.3 L/min. Water is incompressible: the gas of a segment has V(p) less
the water, and the pressure follows from both. At the start water takes the place of gas where the lumen is open for it,
and else the pressure is the one at which both segments hold it. More than they hold at 60 mmHg is refused, and the hand
pours no more into a segment than it holds at 120. A scope that sucks where there is water takes that first, as fast as
it would take gas. `water_volume_mL` is what is there at the end. Water is kept to 10⁻⁶, and where there is none,
pressures are those of gas alone to the bit (`tests/models/gas/test_water.py`).

Water was not there when the colon was imaged in balance, so all of its weight pulls on the axis of a colon that moves,
evenly along its segment, the way that gravity has in the patient's posture: to the back where none is named. Both
backends let the axis sink alike, to 2 % of the way (`tests/envs/sim/test_water.py`). A colon that is fixed bears it.

Assumed: water stays in the segment that it was put in, whatever the posture and the pressure beside it; it neither
leaks at the anus nor is absorbed; its depth, some 4 mmHg at 5 cm, adds nothing to the pressure; it neither wets, nor
floats, nor resists a scope; a scope that stands in it sees as in gas. Many worlds each have their own. Backends are
those of gas; episodes, whose hands have no water, and devices that are no scopes refuse it by name.

The adult scope in grown seed 0 of above, with water and without. It is one colon and one driver, which tells nothing
about people; whether water differs from air as in patients is asked of many by a [trial](trials.md):

"""

_WORLDS = """
## In batches

Each world of `linear` has gas of its own, also in environments (`TaskConfig.gas`), `haustra evaluate --insufflate` and
studies (`scene.gas`). Gas of all worlds moves between control steps, in double precision (`GasWorlds`), by machine
code of the law that numpy runs too (`haustra.envs.sim.linear.row_law`); a step of either is the same to 10⁻¹¹
(`tests/envs/sim/linear/test_row_law.py`). A program takes the width at each station of a world's colon and does to the
shared table, number by number, what `put_distended` does to a table (`haustra.envs.sim.linear.program.HeldOpen`). One
scope alone is the same program. From a table that `put_distended` moved, and from one world to the same among three,
joints are less than 10⁻⁹ m and rad apart after 4 s against a wall in double precision, by the order of sums alone. What
a world does is the same to the bit whatever its neighbours hold, and gas is kept to 10⁻⁶ of what was let in
(`tests/envs/sim/test_gas.py`). The rays that policies see as lumen are as long as gas holds it wide.

`TaskConfig.gas_action` gives a learner the gas: a fifth action lets in or sucks out up to `gas_flow`, and `gas` among
the observations holds the pressure at the tip, the colon's gas and the last action. What is let in is what actions
asked for between two steps of the gas, whole. Drivers that know no such action leave gas to the insufflator
(`tests/envs/tasks/test_gas.py`).

Processor time of the follower's first 20 s, the scope and colon of above, friction from 0.03 to 0.1, from 10 mmHg up to
25, where the lumen is narrower at first and more is touched; at most 1.5 is the bar for one. A step of the gas, eight
to ten a second, takes 24 µs for one world and 0.12 ms for 128, and to say how wide and stiff walls are then 22 µs and
0.2 ms; by numpy it took 0.23 ms for one, and the ratio was 2.22. The program alone takes one world 2 % longer with gas
than without (trials of 25 November 2026):

"""


def gas_page(found: Mapping[str, Any]) -> str:
    """The page as Markdown, from gas.json."""
    people = f"\n{found['people']} people of each cohort; gas is that of the Japanese ones.\n"
    return (
        _HEAD
        + _lines(found["rows"])
        + people
        + _TAIL
        + _RUNS
        + _lines(found["runs"])
        + _WATER
        + _lines(found["water"])
        + _WORLDS
        + _lines(found["worlds"])
    )


def _lines(rows: Sequence[Mapping[str, str]]) -> str:
    """A table as Markdown."""
    head = [[*rows[0]], ["---"] * len(rows[0])]
    return "".join(f"| {' | '.join(row)} |\n" for row in (*head, *(row.values() for row in rows)))


def draw_gas(path: Path, found: Mapping[str, Any]) -> Path:
    """The law by segment, the shares of collapsed segments, and pressures at the tip."""
    import matplotlib.pyplot as plt

    known = gas_numbers()
    pressure = np.linspace(0.0, 60.0, 241)
    figure, (law, shut, tip) = plt.subplots(1, 3, figsize=(13.0, 3.9), layout="constrained")
    for name in SEGMENTS:
        half, exponent = known[f"half_pressure.{name}"], known["exponent"]
        law.plot(pressure, open_share(np, pressure * MMHG, half=half, exponent=exponent), label=name)
    law.axvline(25, color="grey", lw=0.8)
    law.set(xlabel="pressure [mmHg]", ylabel="share of the largest volume", title="Law")
    law.legend(frameon=False, fontsize=8)
    shut.bar(list(SEGMENTS), [100 * found["collapsed"][name] for name in SEGMENTS], color="#7fa6cf")
    shut.set(ylabel="people [%]", title="Collapsed at 25 mmHg")
    shut.tick_params(axis="x", rotation=30)
    tip.hist(found["tip"], bins=20, color="#7fa6cf")
    tip.axvspan(9, 57, color="#b5473c", alpha=0.12)
    tip.set(xlabel="pressure at the tip [mmHg]", ylabel="people", title="After 20 min of 0.25 L/min", xlim=(0, 60))
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=110, format="png"))
    plt.close(figure)
    return path
