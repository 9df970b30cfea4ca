"""What a person sees: progress on stderr, results on stdout."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from haustra.scripts.interruption import raise_if_interrupted


def summary(result: Mapping[str, object]) -> None:
    """Print a result as a table of names and values; its provenance is in the files that it left."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(show_header=False, box=None, pad_edge=False)
    for _ in range(2):
        table.add_column(overflow="fold")  # a name that is cut off names nothing
    for name, value in _rows({name: value for name, value in result.items() if name != "provenance"}):
        table.add_row(Text(one_line(name), style="bold"), Text(one_line(value)))  # brackets are no markup here
    console = Console()
    with console.capture() as rendered:  # rich would turn a reader that has gone into exit code 1
        console.print(table)
    print(rendered.get(), end="")


def one_line(text: str) -> str:
    """A text without what moves a terminal's cursor or begins a line."""
    return "".join(letter if letter.isprintable() else " " if letter.isspace() else "?" for letter in text)


def _rows(result: Mapping[str, object], prefix: str = ""):
    for name, value in result.items():
        if isinstance(value, Mapping):
            yield from _rows(value, f"{prefix}{name}.")
        elif isinstance(value, list | tuple):
            yield f"{prefix}{name}", "; ".join(map(str, value)) or "none"
        else:
            yield f"{prefix}{name}", f"{value:.4g}" if isinstance(value, float) else str(value)


@contextmanager
def progress_bar(title: str, total: float, *, unit: str) -> Iterator[Callable[..., None]]:
    """A bar on stderr; yields a function that takes what is done so far, a note, and a new total if that changed.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed and a library lost it; said at the next call of that function.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}", markup=False),  # titles and names are a stranger's
        BarColumn(),
        TextColumn(f"{{task.completed:.6g}}/{{task.total:.6g}} {unit}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(title, total=total, note="")

        def show(done: float, note: str, total: float | None = None) -> None:
            raise_if_interrupted()
            bar.update(task, completed=done, note=note, total=total)

        yield show
