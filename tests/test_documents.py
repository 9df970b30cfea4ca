"""What the documents tell a user to type works."""

import re
import shlex
from pathlib import Path

import pytest
import tyro

from haustra.scripts.main import verb_of
from haustra.scripts.registry import load_verb

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
COMMANDS = sorted(
    {
        line.split("haustra ", 1)[1].split("#")[0].strip()
        for page in [*PAGES, ROOT / "Makefile"]
        for line in re.findall(
            r"^\s*(?:\$\(BIN\)|\.venv/bin)/haustra .*$", page.read_text(encoding="utf-8"), re.MULTILINE
        )
    }
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str) -> None:
    words = shlex.split(command)
    if words == ["bench", "--list"]:
        return
    name = verb_of(words)
    assert name is not None, command
    assert callable(tyro.cli(load_verb(name), args=words[len(name.split()) :]))


@pytest.mark.slow
def test_the_python_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "README.md", "exec"), {})
    assert "along the colon" in capsys.readouterr().out
    assert (tmp_path / "runs" / "first" / "scores.json").is_file()
