"""The page of the errors that runs state is that of assets/accuracy.toml."""

from pathlib import Path

from haustra.scripts.bench.pages.errors_page import errors_page


def test_the_committed_page_is_current() -> None:
    committed = Path(__file__).parents[4] / "docs" / "validation" / "errors.md"
    assert committed.read_text(encoding="utf-8") == errors_page(), "run `make docs` and commit the page"
