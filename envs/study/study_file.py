"""Studies as files: TOML, or YAML where PyYAML is installed."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, cast, get_args

from haustra.assets import asset
from haustra.envs.study.questions import QUESTIONS, find_question
from haustra.envs.study.read_table import TableReader
from haustra.envs.study.study import (
    Budget,
    Distribution,
    Goal,
    Objective,
    Sampler,
    SamplerKind,
    Study,
    Value,
    Variable,
)
from haustra.errors import HaustraError, UnreadableFileError
from haustra.provenance import content_hash
from haustra.reading import read_document

SHIPPED = (
    "propulsion",
    "scope",
    "scope-mesentery",
    "tracked-reach",
    "tracked-bends",
    "policy-stiffness",
    "cohort-causes",
    "injury-causes",
)
"""Studies that ship, under their names."""
_MOST_TRIED = 100
"""Values of a condition that are tried before a study begins."""


def load_study(name: str | Path) -> Study:
    """A shipped study by its name, or one from a file that ends in .toml, .yaml or .yml.

    Raises:
        UnreadableFileError: when the file is missing, too long, or not of its kind.
        InvalidStudyError: when a key is unknown, missing, or has an impossible value; the message has its path.
        MissingDependencyError: for YAML without PyYAML.
    """
    path = asset(f"studies/{name}.toml") if str(name) in SHIPPED else Path(name)
    if path.suffix not in (".toml", ".yaml", ".yml"):
        raise UnreadableFileError(
            f"'{name}' is no study: name a file that ends in .toml or .yaml, or one of {', '.join(SHIPPED)}."
        )
    return read_study(read_document(path, "study"), path)


def read_study(table: Any, path: Path) -> Study:
    """A study from a parsed file; `path` is where relative names in it start, and what errors are about.

    Raises:
        InvalidStudyError: as `load_study`.
    """
    reader = TableReader(table, "", path.name)
    question = reader.text("question", options=QUESTIONS)
    base = reader.table("base", {})
    variables = tuple(_variable(entry) for entry in reader.tables("variables"))
    if len({variable.name for variable in variables}) < len(variables):
        raise reader.wrong("variables", "two have the same name")
    design, inputs = _design(base.text("design", "default"), path.parent)
    study = Study(
        question=question,
        title=reader.text("title", path.stem),
        base=design,
        variables=variables,
        conditions=_conditions(reader, question, path.parent, inputs),
        objectives=tuple(_objective(entry, question) for entry in reader.tables("objectives")),
        sampler=_sampler(reader.table("sampler", {}), variables),
        scores=_scores(reader, question),
        changes={name: float(value) for name, value in base.plain("values").items() if _is_number(base, name, value)},
        options=_asked(reader.fields("options", find_question(question).options)),
        budget=reader.fields("budget", Budget),
        inputs=inputs,
    )
    base.done()
    reader.done()
    _try_out(study, reader)
    return study


def _asked(options: Any) -> dict[str, Any]:
    """Options that say something: what is left out is no part of a study, or each new option would end its store."""
    return {name: value for name, value in asdict(options).items() if value is not None}


def _variable(reader: TableReader) -> Variable:
    kind = reader.text("distribution", "uniform", options=get_args(Distribution))
    values = reader.numbers("values")
    variable = Variable(
        name=reader.text("name"),
        path=reader.text("path"),
        unit=reader.text("unit"),
        nominal=reader.number("nominal"),
        low=reader.number("low", min(values, default=None)) if values else reader.number("low"),
        high=reader.number("high", max(values, default=None)) if values else reader.number("high"),
        distribution=cast(Distribution, kind),
        deviation=reader.optional("deviation", least=1e-300),
        values=values,
        levels=reader.declared("levels", Variable),
    )
    reader.done()
    if not variable.name.isidentifier():
        raise reader.wrong("name", f"'{variable.name}' is no column name: use letters, digits and _")
    if not variable.low <= variable.nominal <= variable.high:
        raise reader.wrong(
            "nominal", f"{variable.nominal:g} is not from low {variable.low:g} to high {variable.high:g}"
        )
    if variable.low == variable.high and not values:
        raise reader.wrong("high", "is the same as low: there is nothing to vary")
    if values and not variable.low <= min(values) <= max(values) <= variable.high:
        raise reader.wrong("values", "are not all from low to high")
    if kind == "choice" and not values:
        raise reader.wrong("values", "is missing: a choice needs the values to choose from")
    if kind == "log-uniform" and variable.low <= 0:
        raise reader.wrong("low", "must be positive for a log-uniform distribution")
    return variable


def _sampler(reader: TableReader, variables: tuple[Variable, ...]) -> Sampler:
    kind = reader.text("kind", "grid", options=get_args(SamplerKind))
    designs = []
    known = {variable.name for variable in variables}
    for number, entry in enumerate(reader.tables("designs")):
        name = entry.text("name", f"design {number}")
        chosen = {variable.name: entry.number(variable.name, variable.nominal) for variable in variables}
        entry.done()
        designs.append({"name": name, **chosen})
    if "name" in known:
        raise reader.wrong("designs", "no variable may be called 'name'")
    sampler = Sampler(
        kind=cast(SamplerKind, kind),
        count=reader.declared("count", Sampler),
        seed=reader.declared("seed", Sampler),
        designs=tuple(designs),
    )
    reader.done()
    if (kind == "list") != bool(designs):
        raise reader.wrong("designs", "are what a sampler of kind 'list', and no other, needs")
    if len({design["name"] for design in designs}) < len(designs):
        raise reader.wrong("designs", "two have the same name")
    if kind != "list" and not variables:
        raise reader.wrong("kind", f"'{kind}' has nothing to sample: the study has no variables")
    return sampler


def _conditions(reader: TableReader, question: str, folder: Path, inputs: dict) -> dict[str, tuple[Value, ...]]:
    known = find_question(question).conditions
    found: dict[str, tuple[Value, ...]] = {}
    for name, given in reader.plain("conditions").items():
        values = tuple(given) if isinstance(given, list) else (given,)
        where = f"conditions.{name}"
        if name not in known:
            raise reader.wrong(where, f"is not known. Known: {', '.join(known)}")
        if not values or len(set(values)) < len(values):
            raise reader.wrong(where, "is empty or holds a value twice")
        text = known[name].unit == "text"
        if any(isinstance(value, bool) or isinstance(value, str) != text for value in values):
            raise reader.wrong(where, f"expected {'text' if text else 'numbers'}")
        known_as = _case if name == "colon" else _named
        found[name] = tuple(
            known_as(value, folder, inputs) if isinstance(value, str) else float(value) for value in values
        )
    return found


def _named(value: str, folder: Path, inputs: dict) -> str:
    """A name, or a file, made absolute and noted by its hash."""
    place, hashes = _design(value, folder)
    inputs.update(hashes)
    return place


def _case(value: str, folder: Path, inputs: dict) -> str:
    """A grown colon by its seed, or an imported colon's folder, made absolute and noted by its hash."""
    if value.startswith("grown-"):
        return value
    from haustra.models.anatomy.store import colon_hash, load_colon

    place = (folder / value).resolve()
    inputs[str(place)] = colon_hash(load_colon(place))
    return str(place)


def _design(name: str, folder: Path) -> tuple[str, dict[str, str]]:
    if not name.endswith(".toml"):
        return name, {}
    place = (folder / name).resolve()
    try:
        return str(place), {str(place): content_hash(place.read_bytes())}
    except OSError as error:
        raise UnreadableFileError(f"Cannot read the design '{place}': {error.strerror or error}.") from error


def _objective(reader: TableReader, question: str) -> Objective:
    known = [column.name for column in find_question(question).scores if column.unit != "text"]
    objective = Objective(reader.text("score", options=known), cast(Goal, reader.text("goal", options=get_args(Goal))))
    reader.done()
    return objective


def _scores(reader: TableReader, question: str) -> tuple[str, ...]:
    known = [column.name for column in find_question(question).scores]
    wanted = reader.texts("scores")
    for index, name in enumerate(wanted):
        if name not in known:
            raise reader.wrong(f"scores[{index}]", f"'{name}' is not known. Known: {', '.join(known)}")
    return wanted


def _is_number(base: TableReader, name: str, value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise base.wrong(f"values.{name}", f"expected a number, found {value!r}")
    return True


def _try_out(study: Study, reader: TableReader) -> None:
    """Build the nominal design, then it with each variable and condition alone, so that what is bad is named."""
    question = find_question(study.question)
    for name in question.conditions:
        if name not in study.conditions and name not in question.may_lack:
            raise reader.wrong(f"conditions.{name}", "is missing: add a list of values")
    for objective in study.objectives:
        if study.scores and objective.score not in study.scores:
            raise reader.wrong("objectives", f"'{objective.score}' is not among the scores wanted")
    first = {name: values[0] for name, values in study.conditions.items()}
    checks = [("base", study, {})]
    for index, variable in enumerate(study.variables):
        checks.append((f"variables[{index}].path", study, {variable.name: variable.nominal}))
    tried = [(where, asked, values, first) for where, asked, values in checks]
    for name, found in study.conditions.items():
        for index, value in enumerate(found[1:_MOST_TRIED], start=1):
            tried.append((f"conditions.{name}[{index}]", study, {}, {**first, name: value}))
    for where, asked, values, conditions in tried:
        try:
            question.check(asked, values, conditions)
        except HaustraError as error:
            raise reader.wrong(where, str(error).rstrip(".")) from error
