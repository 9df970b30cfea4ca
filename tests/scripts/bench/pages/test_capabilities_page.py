"""The page of what each backend honours is that of the table."""

from pathlib import Path

from haustra.scripts.bench.pages.capabilities_page import capabilities_page


def test_the_committed_page_is_current() -> None:
    committed = Path(__file__).parents[4] / "docs" / "decisions" / "capabilities.md"
    assert committed.read_text(encoding="utf-8") == capabilities_page(), "run `make docs` and commit the page"
