"""The documentation's numbers are the numbers that ship."""

from pathlib import Path

from haustra.scripts.bench.pages.numbers_page import numbers_page


def test_committed_page_is_current() -> None:
    committed = Path(__file__).parents[4] / "docs" / "numbers.md"
    assert committed.read_text(encoding="utf-8") == numbers_page(), "run `make docs` and commit docs/numbers.md"
