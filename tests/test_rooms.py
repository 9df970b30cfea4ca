"""The house holds: which room may import which, and what no file may contain."""

import ast
import subprocess
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("haustra", "assets", "models", "envs", "scripts")
"""In import order: a room may import itself and what stands before it."""
FLOORS = {"sim": 0, "control": 1, "console": 3, "runs": 2, "tasks": 3, "learning": 3, "study": 3, "view": 3}
"""Rooms within envs: each imports those of its own floor and below."""
FILES = [
    *sorted((ROOT / "haustra").glob("*.py")),
    *sorted(path for room in ROOMS[1:] for path in (ROOT / room).rglob("*.py")),
]
HEAVY = ("coacd", "trimesh", "mujoco", "jax", "torch", "matplotlib", "plotly", "scipy", "skfem")


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _statements(body: Sequence[ast.AST]) -> Iterator[ast.AST]:
    """Statements, and those within them; no expressions, of which there are ten times as many."""
    for node in body:
        yield node
        for part in ("body", "orelse", "handlers", "finalbody", "cases"):
            yield from _statements(getattr(node, part, ()))


def _imports(body: Sequence[ast.AST]) -> Iterator[str]:
    for node in _statements(body):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield f"{'.' * node.level}{node.module or ''}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names if node.module == "haustra")


def _room(module: str) -> str:
    """The room that an absolute haustra module stands in; the trunk for 'haustra.errors' and its like."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in ROOMS else "haustra"


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def test_a_room_imports_only_rooms_before_it() -> None:
    wrong = []
    for path in FILES:
        here = ROOMS.index(path.relative_to(ROOT).parts[0])
        # The trunk names its public values for type checkers; those imports never run.
        run = [
            node
            for node in _tree(path).body
            if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
        ]
        for module in _imports(run):
            if module.startswith("."):
                wrong.append(f"{_name(path)} imports {module} relatively: write haustra.x.y")
            elif module.split(".")[0] in ROOMS[1:]:
                wrong.append(f"{_name(path)} imports {module}: write haustra.{module}")
            elif module.split(".")[0] == "haustra" and ROOMS.index(_room(module)) > here:
                wrong.append(f"{_name(path)} imports {module}, which stands after it")
    assert len(FILES) > 400
    assert not wrong


def test_a_room_of_envs_imports_only_its_own_floor_and_below() -> None:
    rooms = [(path, path.relative_to(ROOT).parts) for path in FILES]
    wrong = [
        f"{_name(path)} imports {module}, which stands above it"
        for path, parts in rooms
        if parts[0] == "envs" and len(parts) > 2
        for module in _imports(_tree(path).body)
        if module.startswith("haustra.envs.") and FLOORS[module.split(".")[2]] > FLOORS[parts[1]]
    ]
    assert not wrong


def test_only_scripts_print_and_no_file_is_a_ragbag() -> None:
    ragbags = {"utils", "util", "helpers", "misc", "common"}
    assert not [_name(path) for path in FILES if path.stem in ragbags]
    prints = [
        f"{_name(path)}:{node.lineno}"
        for path in FILES
        if path.relative_to(ROOT).parts[0] != "scripts" and "print" in path.read_text(encoding="utf-8")
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert not prints


@pytest.mark.parametrize("statement", ["import haustra", "from haustra.scripts.main import main; main(['--help'])"])
def test_start_up_loads_nothing_heavy(statement: str) -> None:
    program = (
        "import sys\n"
        f"try:\n    {statement}\nexcept SystemExit:\n    pass\n"
        f"print('LOADED', *sorted(set({HEAVY}) & set(sys.modules)))"
    )
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert finished.stdout.splitlines()[-1].split() == ["LOADED"], "import it inside the function that needs it"
