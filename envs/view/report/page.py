"""One HTML file that works offline: scripts, styles and pictures are inside it."""

import base64
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape
from importlib.resources import files
from pathlib import Path

from haustra.envs.console.motion import player_script
from haustra.envs.view.report.chart import chart_html, figure_html, plotly_script
from haustra.envs.view.report.sections import (
    Chart,
    Gallery,
    Highlights,
    Picture,
    Player,
    Plot,
    Section,
    Table,
    Text,
    Warnings,
)
from haustra.errors import UnreadableFileError
from haustra.files import write_atomically


def write_report(folder: Path, *, title: str, subtitle: str = "", sections: Sequence[Section]) -> Path:
    """Write `report.html`.

    Args:
        folder: an existing folder to write to.
        title: the page's heading.
        subtitle: one line below it.
        sections: what the page shows, from top to bottom.

    Returns:
        The file's path.

    Raises:
        UnreadableFileError: when a picture cannot be read.
        OutputError: when the file cannot be written.
    """
    page = report_html(title=title, subtitle=subtitle, sections=sections)
    return write_atomically(folder / "report.html", lambda temporary: temporary.write_text(page, encoding="utf-8"))


def report_html(*, title: str, subtitle: str = "", sections: Sequence[Section]) -> str:
    """The page as text."""
    style = files("haustra.envs.view.report").joinpath("style.css").read_text(encoding="utf-8")
    body = "\n".join(_section(section, index) for index, section in enumerate(sections))
    script = plotly_script() if any(isinstance(section, Chart | Plot) for section in sections) else ""
    written = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n{script}</head>\n<body>\n<main>\n"
        f"<header><h1>{escape(title)}</h1><p>{escape(subtitle)}</p></header>\n{body}\n"
        f"<footer>Written by haustra, {written}. This file works offline.</footer>\n</main>\n</body>\n</html>\n"
    )


def _section(section: Section, index: int) -> str:
    match section:
        case Highlights():
            return _highlights(section)
        case Player():
            return _titled(section.title, _player(section))
        case Text():
            paragraphs = "".join(f"<p>{escape(paragraph)}</p>" for paragraph in section.paragraphs)
            return _titled(section.title, paragraphs)
        case Warnings():
            items = "".join(f"<li>{escape(message)}</li>" for message in section.messages)
            return f'<section class="warnings"><h2>Warnings</h2><ul>{items}</ul></section>' if items else ""
        case Table():
            return _titled(section.title, _table(section))
        case Picture():
            return _titled(section.title, _figure(section))
        case Gallery():
            figures = "".join(_figure(picture, titled=True) for picture in section.pictures)
            return _titled(section.title, f'<div class="gallery">{figures}</div>')
        case Chart():
            return _titled(section.title, chart_html(section, f"chart-{index}"))
        case Plot():
            return _titled(section.title, figure_html(section.figure, f"chart-{index}") + _note(section.note))


def _player(section: Player) -> str:
    motion = json.dumps(list(section.motion)).replace("<", "\\u003c")
    return (
        f'<div class="player"><script type="application/json">{motion}</script></div>{_note(section.note)}'
        f"<script>{player_script()}</script>"
    )


def _titled(title: str, content: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{content}</section>"


def _highlights(section: Highlights) -> str:
    cards = "".join(
        f"<div><dt>{escape(label)}</dt><dd>{escape(value)}</dd></div>" for label, value in section.values.items()
    )
    return f'<dl class="highlights">{cards}</dl>'


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in table.header)
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table.rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{_note(table.note)}"


def _note(text: str) -> str:
    return f'<p class="note">{escape(text)}</p>' if text else ""


def _figure(picture: Picture, *, titled: bool = False) -> str:
    try:
        content = base64.b64encode(picture.path.read_bytes()).decode("ascii")
    except OSError as error:
        raise UnreadableFileError(f"Cannot read picture '{picture.path}': {error.strerror or error}.") from error
    title = f"<strong>{escape(picture.title)}</strong> " if titled else ""
    caption = f"<figcaption>{title}{escape(picture.caption)}</figcaption>" if title or picture.caption else ""
    kind = picture.path.suffix.removeprefix(".")
    return f'<figure><img alt="{escape(picture.title)}" src="data:image/{kind};base64,{content}">{caption}</figure>'
