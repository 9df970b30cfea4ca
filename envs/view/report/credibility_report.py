"""The two documents of a credibility assessment, of what was looked up and run: every sentence is made of a figure.

FDA's guidance of November 2023 asks for the model's details and for an assessment of its credibility. What an author
writes is quoted as the author's; everything else here is generated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haustra.assets import assets
from haustra.envs.study.credibility import (
    CATEGORIES,
    REQUIRED,
    Applicability,
    ContextOfUse,
    Found,
    applicability,
    file_date,
    missing_categories,
)
from haustra.envs.study.uncertainty import Uncertainty
from haustra.envs.view.report.page import report_html
from haustra.envs.view.report.sections import Highlights, Section, Table, Text, Warnings
from haustra.envs.view.report.values import flat, provenance_table, shown
from haustra.files import write_atomically
from haustra.models.accuracy import QUANTITIES, measured
from haustra.models.devices.scope.files import find_design
from haustra.provenance import Provenance, file_hash
from haustra.quantity import Quantity, load_quantities

MODEL_DETAILS, ASSESSMENT = "model-details.html", "credibility-assessment.html"
_NONE = "none"
_ASSUMED = ("engineering choice", "from memory", "assumed")
"""Words by which the source of a number says that nobody measured it."""


@dataclass(frozen=True)
class Assessment:
    """All that the documents are made of."""

    context: ContextOfUse
    file: Path
    """File that the context was read from."""
    found: Sequence[Found]
    uncertainty: Uncertainty | None
    """Result of the comparison; None where none was asked for."""

    @property
    def missing(self) -> list[int]:
        """Categories without a figure within its bound that the model risk asks for."""
        return missing_categories(self.context, self.found)

    @property
    def unmet(self) -> list[Found]:
        """Figures outside their bounds."""
        return [one for one in self.found if not one.met]

    @property
    def uncovered(self) -> list[Applicability]:
        """Ranges with an end outside all validation points."""
        return [one for one in applicability(self.context) if not one.covered]

    @property
    def adequate(self) -> bool:
        """Whether all evidence asked for stands, over the whole context of use, and the comparison has a sign."""
        resolved = self.uncertainty is not None and self.uncertainty.resolved
        return resolved and not (self.missing or self.unmet or self.uncovered)


def write_documents(folder: Path, assessment: Assessment) -> list[Path]:
    """Write both documents into an existing folder.

    Raises:
        OutputError: when one cannot be written.
        HaustraError: when a file or a design that the context names cannot be read.
    """
    title = assessment.context.title
    pages = {
        MODEL_DETAILS: report_html(title=title, subtitle="Model details", sections=model_details(assessment)),
        ASSESSMENT: report_html(
            title=title, subtitle="Credibility assessment", sections=credibility_assessment(assessment)
        ),
    }
    return [
        write_atomically(folder / name, lambda file, page=page: file.write_text(page, encoding="utf-8"))
        for name, page in pages.items()
    ]


# Model details.


def model_details(assessment: Assessment) -> list[Section]:
    """Sections of the first document."""
    context = assessment.context
    numbers = {
        name: each
        for path in sorted(assets("numbers", ".toml").values())
        for name, each in load_quantities(path).items()
    }
    assumed = {name: each for name, each in numbers.items() if is_assumed(each)}
    sourced = {name: each for name, each in numbers.items() if name not in assumed}
    provenance = Provenance(
        inputs={path.name: file_hash(path) for path in sorted(assets("numbers", ".toml").values())}
        | {assessment.file.name: file_hash(assessment.file)},
        configuration={},
    )
    return [
        Highlights(
            {
                "Numbers in the model": str(len(numbers)),
                "with a source": str(len(sourced)),
                "assumed": str(len(assumed)),
                "Parts described": str(len(context.descriptions)),
            }
        ),
        _said(context),
        _descriptions(assessment),
        *_designs(assessment),
        _numerical_errors(),
        _numbers(
            "Assumptions: numbers chosen, assumed or from memory",
            assumed,
            "Numbers whose source names an engineering choice, an assumption or memory.",
        ),
        _numbers("Numbers with a source", sourced, ""),
        provenance_table(provenance.to_json()),
    ]


def is_assumed(number: Quantity) -> bool:
    """Whether the source of a number says that it is assumed."""
    return any(word in number.source.lower() for word in _ASSUMED)


def _said(context: ContextOfUse) -> Text:
    return Text(
        "What the author asks",
        [
            f"Question of interest: {context.question}",
            f"Context of use: {context.context}",
            f"Quantity of interest: {context.quantity}",
            f"Decision: {context.decision}",
        ],
    )


def _descriptions(assessment: Assessment) -> Table:
    rows = []
    for one in assessment.context.descriptions:
        path = (assessment.file.parent / one.file).resolve()
        rows.append((one.part, one.file, file_date(path), file_hash(path)))
    return Table("What describes each part of the model", ("part", "file", "date", "hash"), rows)


def _designs(assessment: Assessment) -> list[Section]:
    asked = assessment.context.comparison
    if asked is None:
        return []
    designs = [dict(flat(_plain(find_design(name)))) for name in asked.devices]
    rows = [
        (key, *(shown(design.get(key)) for design in designs), "differs" if len({*map(str, values)}) > 1 else "")
        for key in dict.fromkeys(name for design in designs for name in design)
        if (values := [design.get(key) for design in designs])
    ]
    return [Table("The two scopes (SI units, angles in degrees)", ("field", *asked.devices, ""), rows)]


def _plain(design: Any) -> Mapping[str, Any]:
    from dataclasses import asdict

    return asdict(design)


def _numerical_errors() -> Table:
    rows = [
        (
            f"{one.wall_law}{' ' + one.wall if one.wall != 'none' else ''}",
            "moves" if one.mesentery else "fixed",
            one.preset,
            one.colon,
            str(one.colons),
            *(_span(getattr(one.error, name)) for name in QUANTITIES),
        )
        for one in measured()
    ]
    header = ("wall", "colon", "preset", "kind", "colons", "wall force [1]", "push [1]", "tip [mm]")
    return Table("Numerical errors, lowest to highest over colons", header, rows, "Made by 'haustra bench errors'.")


def _span(ends: tuple[float | None, float | None]) -> str:
    low, high = ends
    return _NONE if low is None or high is None else f"{low:.3g} to {high:.3g}"


def _numbers(title: str, numbers: Mapping[str, Quantity], note: str) -> Table:
    rows = [
        (name, shown(each.value), each.unit, f"{shown(each.low)} to {shown(each.high)}", each.source)
        for name, each in numbers.items()
    ]
    return Table(title, ("number", "value", "unit", "range", "source"), rows, note)


# Credibility assessment.


def credibility_assessment(assessment: Assessment) -> list[Section]:
    """Sections of the second document."""
    context, found = assessment.context, assessment.found
    required = REQUIRED[context.risk]
    stands = len(required) - len(assessment.missing)
    result = assessment.uncertainty
    highlights = {
        "Model risk": context.risk,
        "Categories of evidence asked for": f"{stands} of {len(required)} stand",
        "Figures within their bounds": f"{len(found) - len(assessment.unmet)} of {len(found)}",
        "Adequate for the context of use": "yes" if assessment.adequate else "no",
    }
    sections: list[Section] = [Highlights(highlights), Warnings(_reasons(assessment)), _said(context), _risk(context)]
    sections += [_evidence(assessment), _applicability(context)]
    if result is not None:
        sections += [_result(assessment, result), _split(assessment, result)]
    else:
        sections.append(Table("Uncertainty of the quantity of interest", ("part", "value"), [("all", _NONE)]))
    return [*sections, _not_adequate(assessment)]


def _reasons(assessment: Assessment) -> list[str]:
    """Why the evidence is not adequate."""
    reasons = [f"No figure within its bound: {CATEGORIES[category - 1]}." for category in assessment.missing]
    reasons += [f"Outside its bound: {one.evidence.claim}, {_with_unit(one)}." for one in assessment.unmet]
    for one in assessment.uncovered:
        reasons.append(f"Not between validation points: {one.range.name} of {_ends(one)}.")
    if assessment.uncertainty is None:
        reasons.append("The uncertainty of the quantity of interest was not measured.")
    elif not assessment.uncertainty.resolved:
        reasons.append("The sign of the comparison is not resolved: see its interval and each driver's mean.")
    return reasons


def _risk(context: ContextOfUse) -> Table:
    return Table(
        "Model risk",
        ("model influence", "decision consequence", "model risk", "evidence asked for"),
        [
            (
                context.influence,
                context.consequence,
                context.risk,
                ", ".join(f"({category}) {CATEGORIES[category - 1]}" for category in REQUIRED[context.risk]),
            )
        ],
        "Risk is the mean of both levels, rounded up; which categories it asks for is this tool's choice.",
    )


def _evidence(assessment: Assessment) -> Table:
    rows = []
    for category, name in enumerate(CATEGORIES, start=1):
        own = [one for one in assessment.found if one.evidence.category == category]
        rows += [
            (
                f"({category}) {name}",
                one.evidence.claim,
                f"{one.figure:g}{_unit(one.evidence.unit)}",
                f"{one.evidence.relation} {one.evidence.bound:g}{_unit(one.evidence.unit)}",
                "yes" if one.met else "no",
                one.evidence.command,
                f"{one.evidence.file}, {one.date}, {one.hash}",
            )
            for one in own
        ] or [(f"({category}) {name}", *[_NONE] * 6)]
    header = ("category", "figure of", "figure", "bound", "within", "command", "file, date, hash")
    return Table("Evidence", header, rows, "Figures are read from the files; dates are those of the files.")


def _applicability(context: ContextOfUse) -> Table:
    rows = [
        (
            one.range.name,
            _ends(one),
            f"{one.values[0]:g} to {one.values[-1]:g}{_unit(one.range.unit)}" if one.values else _NONE,
            str(len(one.values)),
            str(one.within),
            "yes" if one.covered else "no",
            f"{one.factor:.3g}" if one.factor is not None else _NONE,
        )
        for one in applicability(context)
    ]
    header = (
        "quantity",
        "context of use",
        "validation points",
        "points",
        "within the range",
        "covered",
        "largest factor from an end to the next point",
    )
    names = "; ".join(f"{point.name} ({CATEGORIES[point.category - 1]}, {point.file})" for point in context.points)
    return Table("Applicability", header, rows, f"Validation points: {names or _NONE}.")


def _result(assessment: Assessment, result: Uncertainty) -> Table:
    asked = assessment.context.comparison
    assert asked is not None
    unit = _unit(asked.unit)
    rows = [
        (f"mean of {asked.devices[0]}", f"{result.first:.4g}{unit}"),
        (f"mean of {asked.devices[1]}", f"{result.second:.4g}{unit}"),
        (f"difference, {asked.devices[0]} less {asked.devices[1]}", f"{result.effect:.4g}{unit}"),
        ("95 % interval over patients", f"{result.low:.4g} to {result.high:.4g}{unit}"),
        ("pairs compared, equal caecal intubation", f"{result.pairs}, in {result.reached:.0%} of which at the caecum"),
        ("pairs left out", str(result.left_out)),
        *((f"difference by driver {name}", _or_none(value, unit)) for name, value in result.drivers.items()),
        ("sign resolved", "yes" if result.resolved else "no"),
    ]
    return Table(f"Quantity of interest: {asked.score}", ("figure", "value"), rows)


def _split(assessment: Assessment, result: Uncertainty) -> Table:
    asked = assessment.context.comparison
    assert asked is not None
    unit = _unit(asked.unit)
    parts = {
        "numerical": (result.numerical, "root mean square change of a pair when the time step is halved"),
        "parameter": (result.parameters, f"standard deviation between {asked.parameters} draws of assumed numbers"),
        "between patients": (result.patients, f"standard deviation between {asked.patients} colons"),
        "driver": (result.driver, f"standard deviation between {len(asked.drivers)} drivers' means"),
        "rest": (result.rest, "standard deviation of what colon and draw do not explain, chance included"),
    }
    rows = [(name, _or_none(value, unit), about) for name, (value, about) in parts.items()]
    note = "A standard deviation is 0 where it is not above what chance (the rest) alone would show."
    return Table("Uncertainty of the difference, by where it comes from", ("part", "value", "what it is"), rows, note)


def _not_adequate(assessment: Assessment) -> Table:
    rows = [
        (f"uses that need {CATEGORIES[category - 1]}", f"category ({category}): no figure within its bound")
        for category in range(1, len(CATEGORIES) + 1)
        if not any(one.evidence.category == category and one.met for one in assessment.found)
    ]
    for one in assessment.uncovered:
        if one.values:
            points = f"{one.values[0]:g} to {one.values[-1]:g}{_unit(one.range.unit)}"
            rows.append((f"{one.range.name} outside {points}", f"validation points end there; asked for: {_ends(one)}"))
        else:
            rows.append((f"uses that rest on {one.range.name}", f"no validation point; asked for: {_ends(one)}"))
    result = assessment.uncertainty
    if result is not None and result.reached < 1:
        rows.append(("differences at the caecum", f"both scopes there in {result.reached:.0%} of the pairs"))
    if result is not None and not result.resolved:
        rows.append(("ranking these two scopes", f"95 % interval {result.low:.4g} to {result.high:.4g}"))
    rows += [(text, "ruled out by the author") for text in assessment.context.excluded]
    return Table("Not adequate for", ("use", "why"), rows or [(_NONE, "")])


def _ends(one: Applicability) -> str:
    return f"{one.range.low:g} to {one.range.high:g}{_unit(one.range.unit)}"


def _with_unit(one: Found) -> str:
    asked = one.evidence
    return f"{one.figure:g} instead of {asked.relation} {asked.bound:g}{_unit(asked.unit)}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _or_none(value: float | None, unit: str) -> str:
    return _NONE if value is None else f"{value:.4g}{unit}"
