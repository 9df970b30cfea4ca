"""What pages tell a reader to do is found in order, and run in a folder of its own."""

import re
from pathlib import Path

from haustra.scripts.bench.pages.commands_run import LEFT_OUT, PAGES, run_page, steps_of, why_left_out

_PAGE = """\
# A page

```sh
haustra --help > helped      # a comment
exit 3
```

Its numbers:

```toml
name = "mine"
```

    haustra drive --colon colon \\
        -o mine

```python
import math

print(math.tau)
```

```python
assert math.floor(2.5) == 2
```
"""


def test_steps_come_in_order_without_comments() -> None:
    kinds = [kind for kind, _ in steps_of(_PAGE)]
    assert kinds == ["sh", "sh", "toml", "sh", "python", "python"]
    assert next(steps_of(_PAGE)) == ("sh", "haustra --help > helped")


def test_every_reason_to_leave_something_out_is_needed() -> None:
    printed = "\n".join(step for page in PAGES for _, step in steps_of(page.read_text(encoding="utf-8")))
    for pattern in LEFT_OUT:
        assert re.search(pattern, printed, re.MULTILINE), pattern


def test_a_page_runs_in_its_folder_and_tells_what_failed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(_PAGE, encoding="utf-8")
    given = tmp_path / "given"
    given.mkdir()
    rows = list(run_page(page, tmp_path / "run", colon=given, data=None))
    assert [row.code for row in rows] == [0, 3, None, 0, 0]
    assert rows[2].said == why_left_out(rows[2].what) == "needs a person at a browser"
    assert (tmp_path / "run" / "helped").read_text(encoding="utf-8").startswith("Simulated colons")
    assert (tmp_path / "run" / "mine.toml").read_text(encoding="utf-8") == 'name = "mine"\n'
