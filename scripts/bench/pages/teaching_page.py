"""Write the page on learning from demonstrations from what `haustra bench teaching -o DIR` leaves, once or more often.

`python -m haustra.scripts.bench.pages.teaching_page docs/validation/teaching.md DIR/teaching.json ...`.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.files import write_atomically, write_json
from haustra.reading import read_document

_HEAD = """\
# Validation: learning from demonstrations

**Question.** Does PPO after demonstrations of the endoscopist get further than PPO without, at equal steps?

Made by `python -m haustra.scripts.bench.pages.teaching_page docs/validation/teaching.md DIR/teaching.json ...` from one
teaching.json a lesson, and kept in docs/validation/data/teaching.json; do not edit. Measured with the
endoscopist's settings of before 27 November 2026.
"""
_LESSON = """
## {steps:,} steps

    {command}

{answer}

| who drives | progress, mean of seeds | reached the caecum | peak force [N] |
| --- | --- | --- | --- |
"""
_READ = """
## How to read it

- Episodes are those of the shipped training: a long paediatric scope in grown colons of its band, which move. Trainings
  use as many of its colons as there are demonstrations; all are judged in held-out colons, two episodes each, with
  actions drawn as in training.
- Each driver shows one episode a colon. "Then rewards" is PPO after cloning, in whose first tenth only its critic
  learns; "alone" is cloning without rewards. Steps that were shown are not counted.
- Rewards alone is the same PPO without demonstrations. As shipped trainings explore, it draws actions more widely,
  begins with a push, divides what it sees by its deviation and staggers its first episodes.
- Trainings of an arm have seeds of their own. Intervals are Student's, 95 %, of differences seed by seed.
- Cloning sees one moment and its running means; what a driver remembers (which manoeuvre it is in) it cannot see.
"""
_MAIN = "endoscopist, then rewards"
_KEYS = ("progress", "completion", "peak_force_N")


def teaching_page(kept: Mapping[str, Any]) -> str:
    """The page of several lessons' teaching.json."""
    return _HEAD + "".join(map(_lesson, kept["lessons"])) + _READ


def _lesson(table: Mapping[str, Any]) -> str:
    lesson, arms = table["lesson"], table["arms"]
    command = (
        f"haustra bench teaching -o DIR --training {lesson['training']} --episodes {lesson['episodes']} "
        f"--steps {lesson['steps']} --seeds {lesson['seeds']} --colons {lesson['held_out']} "
        f"--seconds {lesson['seconds']:g}"
    )
    teachers = table["teachers"].items()
    rows = [(f"{name}, the driver itself", *(float(one[key]) for key in _KEYS)) for name, one in teachers]
    rows += [(name, *(float(np.mean(one[key])) for key in _KEYS)) for name, one in arms.items()]
    text = _LESSON.format(steps=lesson["steps"], command=command, answer=_answer(table["gains"]))
    text += "".join(f"| {name} | {far:.2f} | {reached:.2f} | {force:.1f} |\n" for name, far, reached, force in rows)
    text += "\n| progress gained by | over | mean (95 %) |\n| --- | --- | --- |\n"
    for name, others in table["gains"].items():
        text += "".join(f"| {name} | {other} | {_gain(gained)} |\n" for other, gained in others.items())
    return text


def _answer(gains: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    """What the gains of the endoscopist's arm over both others say."""
    said = []
    for other, (mean, low, high) in gains[_MAIN].items():
        verdict = "gets further than" if low > 0 else "falls behind" if high < 0 else "is not told apart from"
        said.append(f"it {verdict} {other} ({_gain((mean, low, high))} of the way)")
    return f"**PPO after demonstrations of the endoscopist: {'; '.join(said)}.**"


def _gain(gained: Sequence[float]) -> str:
    mean, low, high = gained
    return f"{mean:+.3f} ({low:+.3f} to {high:+.3f})"


def main(page: Path, sources: Sequence[Path]) -> None:
    """Keep the measurements beside the page, and write it; without a source from what is kept."""
    kept = page.parent / "data" / f"{page.stem}.json"
    if sources:
        write_json(kept, {"lessons": [read_document(source, "teaching") for source in sources]})
    text = teaching_page(read_document(kept, "teaching"))
    write_atomically(page, lambda file: file.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(source) for source in sys.argv[2:]])
