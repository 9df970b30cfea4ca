"""What `make demo` promises: the policy that ships reaches the caecum of the demo's colon."""

import json
import re
import shlex
from pathlib import Path

import pytest

from haustra.scripts.main import SUCCESS, main

MAKEFILE = Path(__file__).parents[1] / "Makefile"


@pytest.mark.thorough
def test_the_demo_reaches_the_caecum(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And a scope meets its fixed wall of pieces, cut directly here: half of the demo's time goes into CoACD."""
    (recipe,) = re.findall(r"^demo:.*\n((?:\t.*\n)+)", MAKEFILE.read_text(encoding="utf-8"), re.MULTILINE)
    commands = [shlex.split(line) for line in re.findall(r"\$\(BIN\)/haustra (.*)", recipe)]
    assert [command[0] for command in commands] == ["colon", "wall", "run", "run"]
    monkeypatch.chdir(tmp_path)
    for command in (commands[0], commands[2], [*commands[3], "--wall", "prism"]):
        assert main(command) == SUCCESS
    scores = json.loads((tmp_path / "demo/run/scores.json").read_text(encoding="utf-8"))
    assert scores["outcome"] == "completed" and scores["mesentery"] and scores["colon_moved_peak_mm"] > 10
    assert scores["numerical_error"]["wall_force"] and scores["wall_clock_s"] > 0
    assert "motion" in (tmp_path / "demo/run/report.html").read_text(encoding="utf-8")
    assert (tmp_path / "demo/run/film.webp").stat().st_size > 10_000
    fixed = json.loads((tmp_path / "demo/fixed/scores.json").read_text(encoding="utf-8"))
    assert fixed["wall_law"] == "pieces" and not fixed["mesentery"] and fixed["outcome"] != "diverged"
