"""The results of a sweep as tables that other programs read, with a dictionary of their columns."""

from typing import TYPE_CHECKING

from haustra.envs.study.questions import find_question
from haustra.envs.study.sampling import design_names
from haustra.envs.study.store import SweepStore
from haustra.envs.study.study import Column, Study
from haustra.errors import MissingDependencyError, OutputError
from haustra.files import write_atomically, write_json

if TYPE_CHECKING:
    import polars

CSV, PARQUET, DICTIONARY, DICTIONARY_PAGE = "results.csv", "results.parquet", "results.json", "results.md"


def require_polars() -> None:
    """Say what to install, before hours of computing.

    Raises:
        MissingDependencyError: without polars.
    """
    try:
        import polars  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError("Sweeps need polars: install it with 'pip install haustra[sweep]'.") from error


def columns_of(study: Study) -> list[Column]:
    """Every column of the results, in order."""
    question = find_question(study.question)
    wanted = [score for score in question.scores if not study.scores or score.name in study.scores]
    return [
        Column("job", "1", "number of the job: design × number of conditions + place of the condition"),
        Column("design", "1", "number of the design"),
        Column("name", "text", "name of the design, where it has one"),
        *(
            Column(v.column, v.unit, f"variable, applied to {v.path}, from {v.low:g} to {v.high:g}")
            for v in study.variables
        ),
        *(
            Column(column.name, column.unit, f"condition: {column.meaning}")
            for name, column in question.conditions.items()
            if name in study.conditions
        ),
        Column("state", "text", "finished, failed or diverged; a row that is not finished has no scores"),
        Column("reason", "text", "why it failed or diverged"),
        *wanted,
    ]


def results_frame(store: SweepStore) -> "polars.DataFrame":
    """A row for each job that is done, in order; what went wrong has no scores."""
    import polars

    study, columns = store.study, columns_of(store.study)
    names, conditions = design_names(study), find_question(study.question).conditions
    rows = []
    for job in store.rows():
        if job["state"] in ("pending", "claimed"):
            continue
        row = {"job": job["id"], "design": job["design"], "name": names.get(job["design"], "")}
        row |= {variable.column: job["variables"].get(variable.name) for variable in study.variables}
        row |= {conditions[name].name: value for name, value in job["conditions"].items()}
        row |= {"state": job["state"], "reason": job["reason"], **job["scores"]}
        rows.append(tuple(row.get(column.name) for column in columns))
    kinds = {column.name: _kind(column) for column in columns}
    return polars.DataFrame(rows, schema=kinds, orient="row")


def _kind(column: Column):
    import polars

    if column.name in ("job", "design"):
        return polars.Int64
    return polars.String if column.unit == "text" else polars.Float64


def export(store: SweepStore) -> dict[str, str]:
    """Write the results, as CSV and Parquet, and their dictionary, as JSON and Markdown.

    Raises:
        OutputError: when the folder cannot be written.
    """
    frame, folder = results_frame(store), store.folder
    try:
        write_atomically(folder / CSV, frame.write_csv)
        write_atomically(folder / PARQUET, frame.write_parquet)
        write_json(folder / DICTIONARY, dictionary(store))
        page = dictionary_page(store)
        write_atomically(folder / DICTIONARY_PAGE, lambda path: path.write_text(page, encoding="utf-8"))
    except OSError as error:
        raise OutputError(f"Cannot write the results to '{folder}' ({error}): make room, and --resume.") from error
    return {"csv": str(folder / CSV), "parquet": str(folder / PARQUET), "dictionary": str(folder / DICTIONARY)}


def dictionary(store: SweepStore) -> dict:
    """What each column is, and where the rows come from."""
    return {
        "columns": [{"name": c.name, "unit": c.unit, "meaning": c.meaning} for c in columns_of(store.study)],
        "study": store.study.to_json(),
        "study_hash": store.study.hash,
        "kind": store.kind,
        "sessions": store.sessions(),
    }


def dictionary_page(store: SweepStore) -> str:
    """The dictionary for people."""
    rows = "\n".join(f"| `{c.name}` | {c.unit} | {c.meaning} |" for c in columns_of(store.study))
    return (
        f"# {store.study.title}\n\n"
        f"A row for each job of the study; its configuration and versions are in {DICTIONARY}.\n\n"
        f"| column | unit | meaning |\n|---|---|---|\n{rows}\n"
    )
