"""Compiled loops of one checkout are found by the next."""

import os
from pathlib import Path

import pytest

from haustra.models.wall.compiled import loops
from tests.kept_code import bring, keep, take_from_jax

INDEX, CODE = "models/wall/__pycache__/law.py311.nbi", "models/wall/__pycache__/law.py311.1.nbc"


def test_code_goes_from_one_checkout_to_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path / "cache"))
    one, other = tmp_path / "one", tmp_path / "other"
    for name in (INDEX, CODE):
        (one / name).parent.mkdir(parents=True, exist_ok=True)
        (one / name).write_text(name)
    keep(one)
    bring(other)
    assert [(other / name).read_text() for name in (INDEX, CODE)] == [INDEX, CODE]
    (one / INDEX).write_text("newer")
    keep(one)
    bring(other)
    assert (other / INDEX).read_text() == INDEX  # code of its own stays


def test_what_jax_compiled_is_kept_until_it_is_old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path / "cache"))
    for name in ("old-cache", "new-cache", "new-atime"):
        (tmp_path / name).write_text(name)
    take_from_jax(tmp_path)
    kept = sorted((tmp_path / "cache").rglob("*-cache"))
    assert [path.read_text() for path in kept] == ["new-cache", "old-cache"]
    (tmp_path / "old-cache").unlink()
    os.utime(kept[1], (0, 0))
    take_from_jax(tmp_path)
    assert sorted((tmp_path / "cache").rglob("*-*")) == kept[:1]


def test_each_loop_is_kept_by_a_name_of_its_own() -> None:
    names = [each.py_func.__qualname__ for each in loops()]  # pyright: ignore[reportFunctionMemberAccess]
    assert len(set(names)) == len(names) == 16
