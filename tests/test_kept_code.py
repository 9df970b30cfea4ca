"""Compiled loops of one checkout are found by the next."""

from pathlib import Path

import pytest

from haustra.models.wall.compiled import loops
from tests.kept_code import bring, keep

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


def test_each_loop_is_kept_by_a_name_of_its_own() -> None:
    names = [each.py_func.__qualname__ for each in loops()]  # pyright: ignore[reportFunctionMemberAccess]
    assert len(set(names)) == len(names) == 16
