"""What the documents tell a user is there: commands, Python names, links, numbers; and they are in British English."""

import ast
import re
import shlex
import shutil
import subprocess
import sysconfig
import tomllib
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import tyro
from markdown.extensions.toc import slugify

from haustra.envs.runs.insertion import Trajectory
from haustra.envs.runs.outcome import Outcome
from haustra.scripts.main import verb_of
from haustra.scripts.registry import VERBS, load_verb

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")), *sorted(DOCS.rglob("*.md"))]
LOGS = DOCS / "log"
"""Laboratory notes, whose commands and names are of their day."""
TODAY = [page for page in PAGES if LOGS not in page.parents and page.name != "CHANGELOG.md"]
MADE = re.compile(r"docs/reference/(?:command-line\.md|python/)")
"""Pages that exist on the built site only (`haustra.scripts.bench.pages.site`)."""
COMMAND = re.compile(r"^\s*(?:for .* do )?(?:\S*/)?haustra ([a-z].*)$", re.MULTILINE)
MOST_LINES = 150
"""Length of a page of validation: claim, figure, table, command."""


def _text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def _commands() -> Iterator[str]:
    """Commands in blocks of code, fenced or indented, and in the Makefile."""
    for page in [*TODAY, ROOT / "Makefile"]:
        text = re.sub(r"\\\n\s*", "", _text(page))
        text = re.sub(r"^!!! .*\n(?:\n| {4}.*\n)+", "", text, flags=re.MULTILINE)  # indented prose
        fenced = "\n".join(re.findall(r"^```sh\n(.*?)^```", text, re.DOTALL | re.MULTILINE))
        indented = "\n".join(re.findall(r"^(?: {4}|\t)(.*)$", text, re.MULTILINE))
        for said in COMMAND.findall(f"{fenced}\n{indented}"):
            yield re.split(r" #|; done| \|", said)[0].replace("$seed", "0").strip()


COMMANDS = sorted(set(_commands()))


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str) -> None:
    words = shlex.split(command)
    if words == ["bench", "--list"]:
        return
    name = verb_of(words)
    assert name is not None, command
    assert callable(tyro.cli(load_verb(name), args=words[len(name.split()) :]))


@cache
def _options(verb: str) -> frozenset[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the one way to the parser itself
        parser = tyro.extras.get_parser(load_verb(verb))
    return frozenset(option for action in parser._actions for option in action.option_strings)


def test_commands_in_the_text_name_verbs_and_options_that_exist() -> None:
    unknown = []
    for page in TODAY:
        for said in re.findall(r"`haustra ([a-z][^`]*)`", " ".join(_text(page).split())):
            words = said.split()
            verb = verb_of(words)
            options = {word.partition("=")[0].rstrip(",") for word in words if word.startswith("-")}
            if words == ["bench", "--list"] or (len(words) == 1 and any(name.startswith(f"{said} ") for name in VERBS)):
                continue
            if verb is None or not options <= _options(verb) | {"--help"}:
                unknown.append(f"{_name(page)}: haustra {said}")
    assert not unknown


def _links(page: Path) -> Iterator[str]:
    text = re.sub(r"```.*?```|`[^`\n]*`", "", _text(page), flags=re.DOTALL)
    yield from re.findall(r"\]\(([^()\s]+(?:\([^()]*\))?)\)", text)


@cache
def _anchors(page: Path) -> frozenset[str]:
    titles = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", _text(page), flags=re.DOTALL), re.MULTILINE)
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).replace("`", "") for title in titles]
    return frozenset(slugify(title, "-") for title in plain)


def test_every_link_leads_somewhere() -> None:
    broken = []
    for page in PAGES:
        for link in _links(page):
            path, _, anchor = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            if re.match(r"[a-z]+:", link) or (ROOT in target.parents and MADE.match(_name(target))):
                continue
            if not target.exists() or (anchor and anchor not in _anchors(target)):
                broken.append(f"{_name(page)}: {link}")
    assert not broken


def _programs() -> Iterator[tuple[str, str]]:
    for page in TODAY:
        for number, program in enumerate(re.findall(r"^```python\n(.*?)^```", _text(page), re.DOTALL | re.MULTILINE)):
            yield f"{_name(page)}, block {number + 1}", program


def _defines(module: str, name: str) -> bool:
    """Whether a module of haustra defines a name, or is a package that holds it, without importing anything."""
    place = ROOT.joinpath("haustra", *module.split(".")[1:])
    if (place / f"{name}.py").is_file() or (place / name).is_dir():
        return True
    source = place.with_suffix(".py") if place.with_suffix(".py").is_file() else place / "__init__.py"
    return source.is_file() and bool(re.search(rf"\b{re.escape(name)}\b", _text(source)))


@pytest.mark.parametrize(("place", "program"), [pytest.param(*each, id=each[0]) for each in _programs()])
def test_every_program_compiles_and_imports_what_is_there(place: str, program: str) -> None:
    for node in ast.walk(ast.parse(program, place)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("haustra"):
            assert node.module is not None
            assert [each.name for each in node.names if not _defines(node.module, each.name)] == []


def test_files_of_python_in_the_text_are_there() -> None:
    rooms = (ROOT, ROOT / "models", ROOT / "envs", ROOT / "scripts", ROOT / "tests")
    found = [(page, said) for page in TODAY for said in re.findall(r"`((?:[\w-]+/)+[\w-]+\.py)\b", _text(page))]
    assert found
    assert not [f"{_name(page)}: {said}" for page, said in found if not any((room / said).is_file() for room in rooms)]


def test_names_in_the_text_are_those_of_modules() -> None:
    """`haustra.x.y` on a page of today is a module, or a name in one."""
    unknown = []
    for page in TODAY:
        for said in re.findall(r"`(haustra(?!\.x\.)(?:\.\w+)+)", _text(page)):
            parts = said.split(".")
            holder = next((n for n in range(len(parts), 0, -1) if _is_module(parts[1:n])), 0)
            if holder < len(parts) and not _defines(".".join(parts[:holder]), parts[holder]):
                unknown.append(f"{_name(page)}: {said}")
    assert not unknown


def _is_module(parts: list[str]) -> bool:
    place = ROOT.joinpath("haustra", *parts)
    return place.is_dir() or place.with_suffix(".py").is_file()


def test_every_block_of_toml_parses() -> None:
    blocks = [
        block for page in TODAY for block in re.findall(r"^```toml\n(.*?)^```", _text(page), re.DOTALL | re.MULTILINE)
    ]
    assert blocks
    for block in blocks:
        tomllib.loads(block)


def test_pages_of_validation_are_short() -> None:
    pages = [DOCS / "validation.md", *(DOCS / "validation").glob("*.md")]
    long = [_name(page) for page in pages if len(_text(page).splitlines()) > MOST_LINES]
    assert not long, "claim, figure, table, command; history goes to docs/log"


def _criteria() -> list[list[str]]:
    rows = [line.strip("|").split("|") for line in _text(DOCS / "validation.md").splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row] for row in rows[1:]]


def test_the_overview_says_what_its_pages_say() -> None:
    stale = []
    for _, criterion, _, measured, _, page in _criteria():
        (target,) = re.findall(r"\]\(([^)#]+)", page)
        text = _text(DOCS / target)
        numbers = re.findall(r"[−+]?\d[\d.,]*(?: ?·[ ]?10[⁻⁰¹²³⁴-⁹]+|e-?\d+)?", measured)
        stale += [f"{criterion}: {number} is not in {target}" for number in numbers if number.rstrip(".,") not in text]
    assert len(_criteria()) > 40
    assert not stale


def test_every_score_of_a_run_is_explained() -> None:
    explained = set(re.findall(r"`([a-zA-Z]\w*)`", _text(DOCS / "reference" / "scores.md")))
    files = ("measure/scores.py", "measure/injury.py", "measure/load.py", "measure/recorded.py", "device_run.py")
    functions = [
        node
        for file in files
        for node in ast.walk(ast.parse(_text(ROOT / "envs" / "runs" / file)))
        if isinstance(node, ast.FunctionDef) and re.search(r"scores?$|^_gas$|^_looping$", node.name)
    ]
    keys = {
        key.value
        for function in functions
        for node in ast.walk(function)
        if isinstance(node, ast.Dict)
        for key in node.keys
        if isinstance(key, ast.Constant) and isinstance(key.value, str)
    }
    keys |= {outcome.value for outcome in Outcome}
    assert len(keys) > 50
    assert sorted(keys - explained) == [], "describe them in docs/reference/scores.md"


def test_every_array_of_a_trajectory_is_explained() -> None:
    explained = set(re.findall(r"`(\w+)`", _text(DOCS / "reference" / "files.md")))
    assert not set(Trajectory.__dataclass_fields__) - explained, "describe them in docs/reference/files.md"


def _spelt(words: str, *files: str) -> str:
    """What the checker finds in a text, or in files."""
    program = shutil.which("typos", path=sysconfig.get_path("scripts"))
    assert program is not None, "pip install haustra[dev]"
    found = subprocess.run(
        [program, "--config", str(ROOT / "pyproject.toml"), "--format", "brief", *(files or ("-",))],
        input=words,
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    return found.stdout + found.stderr


def test_pages_are_spelt_as_in_british_english() -> None:
    assert not _spelt("", *map(str, PAGES))


def test_docstrings_are_spelt_as_in_british_english() -> None:
    rooms = {"haustra": "*.py"} | dict.fromkeys(("assets", "models", "envs", "scripts"), "**/*.py")
    sources = [_text(path) for room, files in rooms.items() for path in sorted((ROOT / room).glob(files))]
    assert not _spelt("\n".join(said for source in sources for said in re.findall(r'"""(.*?)"""', source, re.DOTALL)))


def test_the_checker_knows_american_from_british() -> None:
    found = _spelt("The color of the center, an esophagus, and a lumnen; ileocecal")
    assert all(word in found for word in ("colour", "centre", "oesophagus", "ileocaecal"))


@pytest.mark.slow
def test_the_python_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "README.md", "exec"), {})
    assert "along the colon" in capsys.readouterr().out
    assert (tmp_path / "runs" / "first" / "scores.json").is_file()
