"""The house holds: which room may import which, and what no file may contain."""

import ast
import subprocess
import sys
from collections.abc import Iterator
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


def _imports(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield f"{'.' * node.level}{node.module or ''}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names if node.module == "haustra")


def _room(module: str) -> str:
    """The room that an absolute haustra module stands in; the trunk for 'haustra.errors' and its like."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in ROOMS else "haustra"


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_a_room_imports_only_rooms_before_it(path: Path) -> None:
    here = ROOMS.index(path.relative_to(ROOT).parts[0])
    tree = ast.parse(path.read_text(encoding="utf-8"))
    # The trunk names its public values for type checkers; those imports never run.
    tree.body = [
        node for node in tree.body if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
    ]
    for module in _imports(tree):
        assert not module.startswith("."), f"{_name(path)} imports {module} relatively: write haustra.x.y"
        assert module.split(".")[0] not in ROOMS[1:], f"{_name(path)} imports {module}: write haustra.{module}"
        if module.split(".")[0] == "haustra":
            assert ROOMS.index(_room(module)) <= here, f"{_name(path)} imports {module}, which stands after it"


@pytest.mark.parametrize("path", [path for path in FILES if path.parts[len(ROOT.parts)] == "envs"], ids=_name)
def test_a_room_of_envs_imports_only_its_own_floor_and_below(path: Path) -> None:
    parts = path.relative_to(ROOT).parts
    if len(parts) == 2:
        return
    for module in _imports(ast.parse(path.read_text(encoding="utf-8"))):
        if module.startswith("haustra.envs."):
            room = module.split(".")[2]
            assert FLOORS[room] <= FLOORS[parts[1]], f"{_name(path)} imports {module}, which stands above it"


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_only_scripts_print_and_no_file_is_a_ragbag(path: Path) -> None:
    assert path.stem not in {"utils", "util", "helpers", "misc", "common"}
    if path.relative_to(ROOT).parts[0] != "scripts":
        calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
        assert not [call.lineno for call in calls if isinstance(call.func, ast.Name) and call.func.id == "print"]


@pytest.mark.parametrize("statement", ["import haustra", "from haustra.scripts.main import main; main(['--help'])"])
def test_start_up_loads_nothing_heavy(statement: str) -> None:
    program = (
        "import sys\n"
        f"try:\n    {statement}\nexcept SystemExit:\n    pass\n"
        f"print('LOADED', *sorted(set({HEAVY}) & set(sys.modules)))"
    )
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert finished.stdout.splitlines()[-1].split() == ["LOADED"], "import it inside the function that needs it"
