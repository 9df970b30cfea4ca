"""Write the page of published trials from what `haustra trials -o DIR` and `haustra bench ultrathin -o DIR` leave.

`python -m haustra.scripts.bench.pages.trials_page docs/validation/trials.md DIR/trials.json DIR/ultrathin.json`; either
alone leaves what is kept of the other.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.files import write_atomically, write_json
from haustra.reading import read_document

ULTRATHIN = "ultrathin"
"""Under what the table of `haustra bench ultrathin` is kept among the trials."""
_HEAD = """\
# Validation: trials with known answers

**Question.** Do published trials of colonoscopes end here as they ended in patients?

Made by `python -m haustra.scripts.bench.pages.trials_page docs/validation/trials.md DIR/trials.json` after
`{command}`, and kept in docs/validation/data/trials.json; do not edit.

Each trial is a file in `assets/trials` with its source, arms, endpoint and what is assumed.
Both arms examine the same virtual patients. A difference is reproduced when the effect has the trial's sign, and
resolved when its whole 95 % interval (bootstrap over patients) does. An equality is reproduced when the effect lies
within the trial's own 95 % interval, and resolved when its whole interval does; at least half of the insertions must
reach the caecum for either: two scopes that hardly ever get there are equal for no good reason. Who cannot tell an
endpoint, as no loop can be seen at a flexure that the tip never came to, does not count in either arm.

**{different} of {all_different} differences and {equal} of {all_equal} equalities are reproduced**; {resolved} of the
{all} are resolved. Criterion: the signs of 5 of 6 differences, and 3 of 3 equalities: {verdict}.

| trial | published | endpoint | first arm | second arm | effect (95 %) | pairs | caecum, both arms \
| effect where both arrive | reproduced |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""
_SCOPES = """
## What keeps the ultrathin scope from the caecum

`haustra bench ultrathin -o DIR --patients {patients} --seconds {seconds:g} --seed {seed}`: the same patients with
scopes that lie between both arms; caeca beyond those of the standard scope, 95 % interval over patients. A soft shaft,
and a soft section behind the bending section of a stiff one, cost as many caeca as both; more shaft brings them back.

| scope | caeca | more than the standard one | shaft inside at the caecum [m] |
| --- | --- | --- | --- |
"""
_READ = """
## How to read it

- Effects are the first arm's less the second's.
- Times are those of the driver's own pace; who does not reach the caecum counts with {seconds:g} s, so that an arm that
  arrives more often may be the faster one though it is slower where both arrive: that effect stands beside it.
- {patients} patients an arm, driven by the {driver}; the trials themselves had 40 to 1,121.
- Published figures are from abstracts; intervals of equal trials are computed from them (Wald).
- Another kind of CPU brings one or two patients of 96 more or fewer to the caecum: courses are sensitive.
{remark}
## What is assumed

"""


def trials_page(table: Mapping[str, Any]) -> str:
    """The page of a folder's trials.json."""
    asked, trials = table["asked"], table["trials"]
    different = [one for one in trials if one["trial"]["expected"] == "different"]
    equal = [one for one in trials if one["trial"]["expected"] == "equal"]
    signs, alike = (sum(one["reproduced"] for one in each) for each in (different, equal))
    command = f"haustra trials -o DIR --patients {asked['patients']} --driver {asked['driver']}"
    head = _HEAD.format(
        command=f"{command} --seconds {asked['seconds']:g} --seed {asked.get('seed', 0)}",
        different=signs,
        all_different=len(different),
        equal=alike,
        all_equal=len(equal),
        resolved=sum(one["resolved"] for one in trials),
        all=len(trials),
        verdict="met" if signs >= 5 and alike == len(equal) else "**not met**",
    )
    rows = "".join(f"| {' | '.join(_row(one))} |\n" for one in trials)
    assumed = "".join(
        f"**{one['trial']['title']}** ({one['trial']['source']}): {'; '.join(one['trial']['assumed'])}.\n\n"
        for one in trials
    )
    remark = f"- {table['remark']}\n" if "remark" in table else ""
    scopes = _scopes(table[ULTRATHIN]) if ULTRATHIN in table else ""
    return f"{head}{rows}{scopes}{_READ.format(**asked, remark=remark)}{assumed}".rstrip("\n") + "\n"


def _scopes(table: Mapping[str, Any]) -> str:
    """The section on scopes between an ultrathin and a standard one."""
    return _SCOPES.format(**table["asked"]) + "".join(
        f"| {one['scope']} | {one['caecum']:.3f} | {one['more']:+.3f} ({one['low']:+.3f} to {one['high']:+.3f}) "
        f"| {'–' if one['inserted_m'] is None else format(one['inserted_m'], '.2f')} |\n"
        for one in table["scopes"]
    )


def _row(one: Mapping[str, Any]) -> tuple[str, ...]:
    trial, reached = one["trial"], one["reached"]
    if one["effect"] is None:
        numbers = ("–", "–", "too few patients", f"{one['patients']}", "–", "–")
    else:
        effect = f"{one['effect']:+.3g} ({one['low']:+.3g} to {one['high']:+.3g})"
        arms = f"{one['first']:.3g}", f"{one['second']:.3g}"
        arrived = "–" if one["arrived"] is None else f"{one['arrived']:+.3g}"
        numbers = (*arms, effect, f"{one['patients']}", f"{reached[0]:.2f}, {reached[1]:.2f}", arrived)
    unit = "" if trial["endpoint"]["unit"] == "1" else f" [{trial['endpoint']['unit']}]"
    named = " / ".join(arm["name"] for arm in trial["arms"])
    verdict = "**no**" if not one["reproduced"] else "yes, resolved" if one["resolved"] else "yes, not resolved"
    return (
        f"{one['name']}: {named}",
        f"{trial['published']} ({trial['expected']})",
        f"{trial['endpoint']['meaning']}{unit}",
        *numbers,
        verdict,
    )


def main(page: Path, sources: Sequence[Path]) -> None:
    """Keep what was measured beside the page, and write it; without a source from what is kept."""
    kept = page.parent / "data" / f"{page.stem}.json"
    table = dict(read_document(kept, "trials")) if kept.exists() else {}
    for source in sources:
        found = dict(read_document(source, "trials"))
        if "scopes" in found:
            table[ULTRATHIN] = found
        else:  # what is kept of scopes stays, nothing else
            table = found | {name: each for name, each in table.items() if name == ULTRATHIN}
    write_json(kept, table)
    text = trials_page(table)
    write_atomically(page, lambda file: file.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(source) for source in sys.argv[2:]])
