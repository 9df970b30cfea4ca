"""Write the page of published trials from what `haustra trials -o DIR` and `haustra bench ultrathin -o DIR` leave.

`python -m haustra.scripts.bench.pages.trials_page docs/validation/trials.md DIR/trials.json DIR/ultrathin.json`, trials
of docs/examples/soft-front, and trials with patients of another seed than 0; each alone leaves what is kept of the
others, and some trials alone, asked for as those that are kept, leave the rest of them.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.errors import InvalidOptionError
from haustra.files import write_atomically, write_json
from haustra.reading import read_document

ULTRATHIN = "ultrathin"
"""Under what the table of `haustra bench ultrathin` is kept among the trials."""
SOFT_FRONT = "soft-front"
"""Under what trials of docs/examples/soft-front are kept."""
OTHERS = "other-patients"
"""Under what trials with patients of another seed are kept."""
_USUAL, _SEED = "endoscopist", 0
_HEAD = """\
# Validation: trials with known answers

**Question.** Do published trials of colonoscopes end here as they ended in patients?

Made by `python -m haustra.scripts.bench.pages.trials_page docs/validation/trials.md DIR/trials.json` after
{command}, and kept in docs/validation/data/trials.json; do not edit.
29 November 2026, two Xeon cores; water and length, and of [other patients](#other-patients) stiffening, tapered,
variable stiffness and water, on 16 of another machine.

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
_OTHERS = """
## Other patients

`haustra trials {names} -o DIR{asks}`: patients whom nothing was chosen by. That gas is sucked out, that the hand slows
down late, and that what lies around colons is as stiff as 200 N/m² was tried because of trials with the patients above,
and chosen by a cohort of others ([cohort](cohort.md)), so that those above are no fresh evidence. **Here the
paediatric scope of variable stiffness misses its equality**, whose interval begins at -0.022, and which it meets above
by 0.001. In 600 of seed 2 (`haustra trials paediatric-adult -o DIR --patients 600 --seconds 960 --seed 2 --backend
linear-gpu`, one H200) it reaches 0.938 of caeca and the adult one 0.962: -0.023 (-0.037 to -0.012), missed by 0.001. In
three patients that were looked at it fails as a loop of half a metre, pulled out, comes again when it is pushed, the
tip in the ascending colon. **It hangs on how much the ring stiffens**, for which no source was found: 1.3 is assumed,
of 1.1 to 2.0. With 2.0 the same scope reaches 0.958 in the same 600, -0.003 (-0.010 to +0.003), the whole interval
within the trial's (`haustra trials docs/examples/stiffer-ring/paediatric-adult.toml -o DIR`, else as before). The ring
that ships stays at 1.3: to choose it by this trial would make that no evidence.

| trial | effect (95 %) | caecum, both arms | effect where both arrive | reproduced |
| --- | --- | --- | --- | --- |
"""
_SCOPES = """
## What keeps the ultrathin scope from the caecum, and what brings it there

`haustra bench ultrathin -o DIR --patients {patients} --seconds {seconds:g} --seed {seed}`: the same patients with
scopes that lie between both arms, by the usual endoscopist, who sucks gas out, and by one who leaves it
(`docs/examples/gas-left.toml`); caeca beyond those of the standard scope with the same endoscopist, 95 % interval over
patients.

| scope | caeca | more than the standard one | shaft inside there [m] | caeca with gas left | more | shaft inside [m] |
| --- | --- | --- | --- | --- | --- | --- |
"""
_FRONT = """
## If a ring leaves a scope's front soft

`haustra trials docs/examples/soft-front/*.toml -o DIR{asks}`. How much of a shaft a stiffening ring stiffens is not
published in what was found; the trials above have it stiffen all. Textbooks have the leading 30 cm stay as soft as they
are, as far as memory goes. Then signs are the same, but none is resolved, and the tapered scope is hardly faster than
the paediatric one of variable stiffness, whose front stays soft.

| trial | effect (95 %) | caecum, both arms | effect where both arrive | reproduced |
| --- | --- | --- | --- | --- |
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
    """The page of a folder's trials.json, with what is kept beside it."""
    asked, trials = table["asked"], table["trials"]
    counts = _counts(trials)
    met = counts["different"] >= 5 and counts["equal"] == counts["all_equal"]
    head = _HEAD.format(
        command=_command(asked),
        resolved=sum(one["resolved"] for one in trials),
        all=len(trials),
        verdict="met" if met else "**not met**",
        **counts,
    )
    rows = "".join(f"| {' | '.join(_row(one))} |\n" for one in trials)
    assumed = "".join(
        f"**{one['trial']['title']}** ({one['trial']['source']}): {'; '.join(one['trial']['assumed'])}.\n\n"
        for one in trials
    )
    remark = f"- {table['remark']}\n" if "remark" in table else ""
    scopes = _scopes(table[ULTRATHIN]) if ULTRATHIN in table else ""
    others = _others(table[OTHERS]) if OTHERS in table else ""
    front = _front(table[SOFT_FRONT]) if SOFT_FRONT in table else ""
    return f"{head}{rows}{others}{front}{scopes}{_READ.format(**asked, remark=remark)}{assumed}".rstrip("\n") + "\n"


def _counts(trials: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """How many differences and equalities there are, and are reproduced."""
    found = {}
    for kind in ("different", "equal"):
        of_kind = [one["reproduced"] for one in trials if one["trial"]["expected"] == kind]
        found |= {kind: sum(of_kind), f"all_{kind}": len(of_kind)}
    return found


def _command(asked: Mapping[str, Any]) -> str:
    return f"`haustra trials -o DIR --driver {asked['driver']}{_asks(asked)}`"


def _asks(asked: Mapping[str, Any]) -> str:
    return "".join(f" --{name} {asked[name]:g}" for name in ("patients", "seconds", "seed"))


def _others(table: Mapping[str, Any]) -> str:
    """The section on trials with other patients."""
    names = " ".join(one["name"] for one in table["trials"])
    return _OTHERS.format(names=names, asks=_asks(table["asked"])) + _short_rows(table["trials"])


def _front(table: Mapping[str, Any]) -> str:
    """The section on rings that leave a scope's front soft."""
    return _FRONT.format(asks=_asks(table["asked"])) + _short_rows(table["trials"])


def _short_rows(trials: Sequence[Mapping[str, Any]]) -> str:
    """Rows of trials that are told elsewhere: name, effect, who arrives, verdict."""
    rows = [(Path(one["name"]).stem, _row(one)) for one in trials]
    return "".join(f"| {name} | {row[5]} | {row[7]} | {row[8]} | {row[9]} |\n" for name, row in rows)


def _scopes(table: Mapping[str, Any]) -> str:
    """The section on scopes between an ultrathin and a standard one."""
    told = "".join(
        f"| {one['scope']} | {_caeca(one['caecum'])} | {_caeca(one['caecum_with_gas_left'])} |\n"
        for one in table["scopes"]
    )
    return _SCOPES.format(**table["asked"]) + told


def _caeca(found: Mapping[str, Any]) -> str:
    more = f"{found['more']:+.3f} ({found['low']:+.3f} to {found['high']:+.3f})"
    inside = "–" if found["inserted_m"] is None else format(found["inserted_m"], ".2f")
    return f"{found['share']:.3f} | {more} | {inside}"


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


def _in_their_place(found: Mapping[str, Any], kept: Mapping[str, Any]) -> dict[str, Any]:
    """What was found, with those trials that are kept beside it where they were asked for alike."""
    asked_alike = kept.get("asked") == found["asked"]
    trials = {one["name"]: one for one in (*(kept["trials"] if asked_alike else ()), *found["trials"])}
    return {**found, "trials": [trials[name] for name in sorted(trials)]}


def main(page: Path, sources: Sequence[Path]) -> None:
    """Keep what was measured beside the page, and write it; without a source from what is kept."""
    kept = page.parent / "data" / f"{page.stem}.json"
    table = dict(read_document(kept, "trials")) if kept.exists() else {}
    for source in sources:
        found = dict(read_document(source, "trials"))
        if "scopes" in found:
            table[ULTRATHIN] = found
        elif found["asked"]["driver"] != _USUAL:
            raise InvalidOptionError(f"{source}: driven by {found['asked']['driver']}; the page is of the {_USUAL}.")
        elif all(SOFT_FRONT in one["name"] for one in found["trials"]):
            table[SOFT_FRONT] = found
        elif found["asked"]["seed"] != _SEED:
            table[OTHERS] = _in_their_place(found, table.get(OTHERS, {}))
        else:  # what is kept beside the trials stays, nothing else
            beside = {name: each for name, each in table.items() if name in (ULTRATHIN, SOFT_FRONT, OTHERS)}
            table = _in_their_place(found, table) | beside
    write_json(kept, table)
    text = trials_page(table)
    write_atomically(page, lambda file: file.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(source) for source in sys.argv[2:]])
