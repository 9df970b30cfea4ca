"""Pages that exist on the built site only: every verb of the command line, and every public name of the package.

MkDocs calls these functions by name (`hooks` in mkdocs.yml). Neither page can be older than what it describes.
"""

import tomllib
import warnings
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from haustra import _HOME
from haustra.scripts.registry import BENCHMARKS, GROUPS, VERBS, load_verb

_ROOT = Path(__file__).parents[3]
_PYTHON = "reference/python.md"
_LEFT_OUT = "haustra.scripts"
"""Verbs have the page of commands; benchmarks are not meant to be imported."""


_ABOUT = """\
# {package}

::: {package}
    options:
      show_root_heading: false
      show_root_toc_entry: false
      members: false
"""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of packages into the navigation, below the page that introduces them."""
    reference = next(group["Reference"] for group in config.nav or () if "Reference" in group)
    python = next(entry["Python"] for entry in reference if "Python" in entry)
    python += [{name.removeprefix("haustra."): _page_of(name)} for name in packages()]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here."""
    made = {"reference/command-line.md": command_line_page()} | {_page_of(name): api_page(name) for name in packages()}
    for path, text in made.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let the search find guides before lists of names and notes of days that are over."""
    if page.file.src_uri.startswith(("log/", "reference/python/")):
        page.meta["search"] = {"boost": 0.2}
    return markdown


def packages() -> list[str]:
    """Packages whose names are documented: all that ship but the command line and its benchmarks."""
    listed = tomllib.loads((_ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    return [name for name in listed if not name.startswith(_LEFT_OUT)]


def api_page(package: str) -> str:
    """Markdown that names every public module of a package, for mkdocstrings to fill in."""
    folder = _ROOT.joinpath(*package.split(".")[1:]) if package != "haustra" else _ROOT / "haustra"
    modules = sorted(path.stem for path in folder.glob("*.py") if not path.stem.startswith("_"))
    body = "".join(f"\n::: {package}.{module}\n" for module in modules)
    about = _ABOUT.format(package=package)
    return about + (_first_names() if package == "haustra" else "") + body


def _first_names() -> str:
    """The names that `import haustra` gives, with links to where they are described."""
    rows = "".join(
        f"| [`haustra.{name}`][{module}.{name}] | `{module}` |\n" for module, names in _HOME.items() for name in names
    )
    return f"\n## Names at the top\n\n| name | stands in |\n|---|---|\n{rows}"


def command_line_page() -> str:
    """Every verb with its options, as the parsers know them."""
    parts = [
        "# Command line\n\nEvery verb and its options. This page is made from the parsers when the site is built; "
        "`haustra VERB --help` prints the same. Verbs that take `--json` then print one JSON document. Exit codes are "
        "0 for success, 2 for bad input, 3 for a simulation that diverged and 130 for an interruption.\n"
    ]
    grouped = {name for verbs in GROUPS.values() for name in verbs} | BENCHMARKS.keys()
    further = [name for name in VERBS if name not in grouped]
    for title, verbs in {**GROUPS, "Further verbs": further, "Benchmarks": BENCHMARKS}.items():
        if not verbs:
            continue
        parts += [f"\n## {title}\n", *(_verb(name) for name in verbs)]
    return "\n".join(parts)


def _verb(name: str) -> str:
    import tyro

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the one way to the parser itself
        parser = tyro.extras.get_parser(load_verb(name), prog=f"haustra {name}")
    actions = [action for action in parser._actions if action.dest != "help"]
    needed = [_given(action) for action in actions if not action.option_strings or "(required)" in str(action.help)]
    usage = " ".join([f"haustra {name}", *needed, "[options]" if len(needed) < len(actions) else ""]).rstrip()
    rows = "".join(f"| `{_name(action)}` | {_value(action)} | {_about(action)} |\n" for action in actions)
    about = _plain(parser.description or "")
    table = f"| option | value | meaning |\n|---|---|---|\n{rows}"
    return f"### haustra {name}\n\n{about}\n\n```text\n{usage}\n```\n\n{table}"


def _name(action: Any) -> str:  # argparse's Action, of which tyro has a copy of its own
    """Its names on the command line, without the `--no-` of a switch; in capitals when it is given by its place."""
    return ", ".join(name for name in action.option_strings if not name.startswith("--no-")) or action.dest.upper()


def _given(action: Any) -> str:
    """What a call cannot do without: a word in its place, or an option with its value."""
    return f"{action.option_strings[0]} {action.metavar}" if action.option_strings else action.dest.upper()


def _value(action: Any) -> str:
    value = "" if action.metavar is None else str(action.metavar).replace("{None}|", "").replace("{None,", "{")
    return f"`{value}`" if value else ""


def _about(action: Any) -> str:
    said = " ".join(str(action.help or "").split())
    for nothing in ("(default: )", "(default: None)", "(default: False)"):
        said = said.replace(nothing, "")
    return _plain(said.strip().replace("|", "\\|"))


def _plain(said: str) -> str:
    """Words of a help text, in which Markdown finds no links, no tags and nothing to stress."""
    return said.replace("[", "\\[").replace("*", "\\*").replace("<", "&lt;")


def _page_of(package: str) -> str:
    return f"reference/python/{package}.md"
