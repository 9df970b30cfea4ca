"""What a person sees: progress on stderr, results on stdout."""

from collections.abc import Mapping


def summary(result: Mapping[str, object]) -> None:
    """Print a result as a table of names and values."""
    from rich.console import Console
    from rich.table import Table

    table = Table(show_header=False, box=None, pad_edge=False)
    for name, value in _rows(result):
        table.add_row(f"[bold]{name}[/bold]", value)
    Console().print(table)


def _rows(result: Mapping[str, object], prefix: str = ""):
    for name, value in result.items():
        if isinstance(value, Mapping):
            yield from _rows(value, f"{prefix}{name}.")
        elif isinstance(value, list | tuple):
            yield f"{prefix}{name}", "; ".join(map(str, value)) or "none"
        else:
            yield f"{prefix}{name}", f"{value:.4g}" if isinstance(value, float) else str(value)
