"""Run every command and program of the README, tutorials and how-to pages as printed, a page a folder.

What came of it is kept.

`python -m haustra.scripts.bench.pages.commands_run DIR [--data FOLDER] [PAGE ...]` leaves pages out that
DIR/commands.json holds already; `--failed` runs what failed again, in the folders that pages left there.
`commands_page` makes a page of it.
"""

import argparse
import ast
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from datetime import date
from pathlib import Path

from haustra.files import write_atomically
from haustra.scripts.bench.machine import machine

ROOT = Path(__file__).resolve().parents[3]
PAGES = (
    ROOT / "README.md",
    *sorted([*(ROOT / "docs/how-to").glob("*.md"), *(ROOT / "docs/tutorials").glob("*.md")]),
)
LEFT_OUT = {
    r"insertion-cpu": "takes 22 minutes on two cores (docs/validation/navigation.md)",
    r"insertion-gpu|runs/gpu|runs/depth( |$)|runs/colour|linear-gpu|--processes 16|backend=\"warp\"": (
        "needs an NVIDIA GPU"
    ),
    r"runs/withdrawal|evaluate withdrawal": "takes half an hour on two cores",
    r"insertion-ppo|runs/ppo|train --from-dem|cohort full": "takes hours on two cores",
    r"^haustra drive|haptic|replay my-drive|export my-drive": "needs a person at a browser (tests/envs/console)",
    r"patients=48|cohort quick .*--driver endoscopist \w": "a longer form of the command above it",
    r"labels\.nii\.gz": "another form of the command above it (tests/models/anatomy/test_label_map.py)",
    r"^make demo": "tried by itself (tests/test_demo.py)",
    r"^make test": "tried by itself at every change",
    r"my-study|sweeps/mine": "a study of the reader's own; the tutorial's stands for it",
}
"""What is printed and not run here, and why, by pattern."""
LONGEST = 1800.0
"""Time after which a command counts as hanging [s]."""
_TAIL = 600
_BLOCK = re.compile(r"^```(sh|python|toml)\n(.*?)^```|^((?: {4}haustra [^\n]*\n)+)", re.DOTALL | re.MULTILINE)
_GIVEN = ("colon", "case/colon", "demo/colon")
"""Where pages expect a colon that the reader has."""


@dataclass(frozen=True)
class Ran:
    """One command or program of a page."""

    page: str
    what: str
    seconds: float
    code: int | None
    """Exit code; nothing where it was left out."""
    said: str
    """The end of what it printed, or why it was left out."""
    date: str = field(default_factory=lambda: date.today().isoformat())
    """Day on which it was tried."""


def steps_of(page: str) -> Iterator[tuple[str, str]]:
    """Kinds and texts of what a page tells a reader to do, in order: sh (a line each), python, toml."""
    for kind, block, indented in _BLOCK.findall(page):
        if kind in ("python", "toml"):
            yield kind, block
            continue
        for line in re.sub(r"\\\n\s*", "", block or indented).splitlines():
            if said := re.split(r"\s#\s", line)[0].strip():
                yield "sh", said


def printed(page: Path) -> list[str]:
    """What a page prints to be run: commands, and programs by their last lines."""
    steps = steps_of(page.read_text(encoding="utf-8"))
    return [shown(kind, step) for kind, step in steps if kind != "toml"]


def shown(kind: str, step: str) -> str:
    """A command, or the last line of a program."""
    return step if kind == "sh" else step.strip().splitlines()[-1]


def why_left_out(text: str) -> str | None:
    """Why a command is not run, or nothing."""
    return next((why for pattern, why in LEFT_OUT.items() if re.search(pattern, text)), None)


def changed(text: str, block: str) -> str:
    """A TOML file in which a reader has made the keys and tables of a block what the block says."""
    keys, *tables = re.split(r"^(?=\[)", block, flags=re.MULTILINE)
    for table in tables:
        head = re.escape(table.split("]")[0] + "]")
        text = re.sub(rf"^{head}\n.*?(?=^\[|\Z)", "", text, flags=re.MULTILINE | re.DOTALL)
    for line in filter(str.strip, keys.splitlines()):
        text = re.sub(rf"^{re.escape(line.split('=')[0])}=.*\n", "", text, count=1, flags=re.MULTILINE)
    return "\n".join(part for part in (keys, text, *tables) if part)


def definitions(program: str) -> list[str]:
    """What later programs of a page take over from one: imports, functions and classes."""
    kept = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef)
    return [ast.unparse(part) for part in ast.parse(program).body if isinstance(part, kept)]


def prepare_page(text: str, folder: Path, *, colon: Path, data: Path | None) -> None:
    """Make a new folder that holds what a reader of a page has.

    Args:
        text: the page.
        folder: made anew.
        colon: folder of a colon for those who are told to bring one.
        data: folder of real colons, or nothing.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("assets", "docs"):
        (folder / name).symlink_to(ROOT / name)
    (folder / ".venv").symlink_to(Path(sys.prefix))
    if data is not None:
        shutil.copy(data / "colons" / "HuBMAPVHM_3D_00070_lumen_mm.stl", folder / "lumen.stl")
    for name in _GIVEN:
        if name in text and f"colon grow --seed 4 -o {name}" not in text:
            shutil.copytree(colon, folder / name)


def run_page(page: Path, folder: Path, *, only: Sequence[str] | None = None) -> Iterator[Ran]:
    """Run a page's commands in a folder that is prepared for it.

    Args:
        page: the page.
        folder: as `prepare_page` left it, or commands before.
        only: which commands, and programs by their last lines; all when None.
    """
    text = page.read_text(encoding="utf-8")
    known: list[str] = []
    for number, (kind, step) in enumerate(steps_of(text)):
        if kind == "toml":
            mine = folder / ("stiffness.toml" if "stiffness.toml" in text else "mine.toml")
            mine.write_text(changed(mine.read_text(encoding="utf-8") if mine.exists() else "", step), encoding="utf-8")
            continue
        what = shown(kind, step)
        if only is not None and what not in only:
            known += definitions(step) if kind == "python" else []
            continue
        if why := why_left_out(step):
            yield Ran(page.name, what, 0.0, None, why)
            continue
        command = ["bash", "-c", step]
        if kind == "python":
            (folder / f"program-{number}.py").write_text("\n".join([*known, step]), encoding="utf-8")
            known += definitions(step)
            command = [sys.executable, f"program-{number}.py"]
        yield _ran(page.name, what, command, folder)


def _ran(page: str, what: str, command: list[str], folder: Path) -> Ran:
    began, around = time.monotonic(), {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=around, capture_output=True, text=True, timeout=LONGEST, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        return Ran(page, what, LONGEST, 124, "it had not ended by then")
    said = (done.stdout + done.stderr).strip()[-_TAIL:]
    return Ran(page, what, round(time.monotonic() - began, 1), done.returncode, said)


def main() -> int:
    """Run pages that were not run yet; 1 when a command failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("pages", nargs="*", help="names such as own-scope.md; all when none is given")
    parser.add_argument("--data", type=Path, default=None, help="folder of the real colons")
    parser.add_argument("--failed", action="store_true", help="run what failed again")
    asked = parser.parse_intermixed_args()  # pages may come after --data
    found = asked.folder / "commands.json"
    rows = [Ran(**row) for row in json.loads(found.read_text(encoding="utf-8"))["rows"]] if found.exists() else []
    colon = asked.folder / "given"
    if not colon.exists():
        subprocess.run([sys.executable, "-m", "haustra.scripts.main", "colon", "grow", "-o", str(colon)], check=True)
    for page in PAGES:
        held = [row for row in rows if row.page == page.name]
        failed = [row.what for row in held if row.code]
        if (asked.pages and page.name not in asked.pages) or (held and not (asked.failed and failed)):
            continue
        folder, new = asked.folder / page.stem, list[Ran]()
        if not held:
            prepare_page(page.read_text(encoding="utf-8"), folder, colon=colon.resolve(), data=asked.data)
        for row in run_page(page, folder, only=failed if held else None):
            new.append(row)
            print(row.page, row.code, f"{row.seconds:.0f} s", row.what, row.said if row.code else "", flush=True)
        again = {(row.page, row.what): row for row in new if held}
        rows = [again.get((row.page, row.what), row) if row.code else row for row in rows] + ([] if held else new)
        kept = {"machine": machine(), "rows": [asdict(row) for row in rows]}
        write_atomically(found, lambda place, kept=kept: place.write_text(json.dumps(kept, indent=1), encoding="utf-8"))
    return int(any(row.code for row in rows))


if __name__ == "__main__":
    sys.exit(main())
