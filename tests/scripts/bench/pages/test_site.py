"""The page of all verbs, which is made when the site is built."""

import re

from haustra.scripts.bench.pages.site import command_line_page


def test_help_texts_hold_no_links_that_lead_nowhere() -> None:
    """Two brackets in a row, as in [:TYPE][*COUNT], are a link to Markdown, and stop the strict build."""
    page = re.sub(r"```.*?```|`[^`\n]*`", "", command_line_page(), flags=re.DOTALL)
    assert "][" in page.replace("\\", "")
    assert not re.findall(r"(?<!\\)\[[^\]\n]*\]", page)
    assert "medium*8" in page.replace("\\", "") and "medium*8" not in page, "two stars would be italics"
