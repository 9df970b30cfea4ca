"""What is on disk is what is installed."""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import haustra

ROOT = Path(__file__).parents[1]
ROOMS = ("assets", "models", "envs", "scripts")


def _packages_on_disk() -> set[str]:
    found = {"haustra"}
    for room in ROOMS:
        for marker in (ROOT / room).rglob("__init__.py"):
            found.add("haustra." + marker.parent.relative_to(ROOT).as_posix().replace("/", "."))
    return found


def test_package_list_matches_the_disk() -> None:
    """Setuptools ships only what pyproject.toml names: a folder forgotten there is missing from the wheel."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["packages"]
    assert sorted(listed) == sorted(_packages_on_disk())


def test_the_version_is_said_alike_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert haustra.__version__ == project["version"]
    assert f"\nversion: {project['version']}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {project['version']}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_every_public_name_is_there_and_another_is_refused_with_those_there_are() -> None:
    for name in haustra.__all__:
        assert getattr(haustra, name) is not None
    assert {*haustra.__all__} == {"__version__", *(name for names in haustra._HOME.values() for name in names)}
    with pytest.raises(AttributeError, match=r"Public names: .*grow_colon"):
        getattr(haustra, "nothing")  # noqa: B009


def test_every_folder_with_code_is_a_package() -> None:
    for room in ROOMS:
        for path in (ROOT / room).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), f"{path.parent} holds code and no __init__.py"


def test_locks_hold_every_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    core = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    for requirement in project["dependencies"]:
        name = requirement.split(">")[0].split("=")[0].split("[")[0].strip()
        assert f"\n{name}==" in core, f"{name} is not locked: run `make lock`"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built wheel; from a copy, since what an earlier build left in build/ would be packed too."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in ("haustra", *ROOMS):
        shutil.copytree(ROOT / name, source / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", out, source]
    finished = subprocess.run(build, capture_output=True, text=True, timeout=120)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return next(out.glob("*.whl"))


def test_wheel_holds_every_file(wheel: Path) -> None:
    inside = set(zipfile.ZipFile(wheel).namelist())
    wanted = {f"haustra/{path.name}" for path in (ROOT / "haustra").glob("*.py")} | {"haustra/py.typed"}
    for room in ROOMS:
        for pattern in ("*.py", "*.toml", "*.csv", "*.png", "*.css", "*.html", "console.js"):
            wanted |= {f"haustra/{path.relative_to(ROOT).as_posix()}" for path in (ROOT / room).rglob(pattern)}
    assert not wanted - inside


def test_wheel_works_without_the_checkout(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    program = (
        "import haustra, haustra.scripts.doctor; from haustra.assets import asset;"
        "print(haustra.__file__, asset('numbers/scope.toml'))"
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    finished = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, cwd=tmp_path, env=environment
    )
    assert finished.returncode == 0, finished.stderr
    assert all(Path(found).is_relative_to(tmp_path) for found in finished.stdout.split())
