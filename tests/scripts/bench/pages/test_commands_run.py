"""What pages tell a reader to do is found in order, and run in a folder of its own."""

import re
import tomllib
from pathlib import Path

from haustra.scripts.bench.pages.commands_run import (
    LEFT_OUT,
    PAGES,
    changed,
    definitions,
    prepare_page,
    run_page,
    steps_of,
    why_left_out,
)

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
    prepare_page(_PAGE, tmp_path / "run", colon=given, data=None)
    rows = list(run_page(page, tmp_path / "run"))
    assert [row.code for row in rows] == [0, 3, None, 0, 0]
    assert rows[2].said == why_left_out(rows[2].what) == "needs a person at a browser (tests/envs/console)"
    assert (tmp_path / "run" / "helped").read_text(encoding="utf-8").startswith("Simulated colons")
    assert (tmp_path / "run" / "mine.toml").read_text(encoding="utf-8") == 'name = "mine"\n'
    again = list(run_page(page, tmp_path / "run", only=[rows[1].what, rows[4].what]))
    assert [(row.what, row.code) for row in again] == [(row.what, row.code) for row in (rows[1], rows[4])]


def test_a_block_changes_a_file_as_its_reader_does() -> None:
    before = 'kind = "capsule"\nname = "capsule"\n\n[mass]\nvalue = 1.0\n\n[friction]\nvalue = 0.1\n'
    after = tomllib.loads(changed(before, 'name = "mine"\n\n[friction]\nvalue = 0.03\n'))
    assert after == {"kind": "capsule", "name": "mine", "mass": {"value": 1.0}, "friction": {"value": 0.03}}
    assert changed("", 'name = "mine"\n').strip() == 'name = "mine"'


def test_later_programs_know_what_earlier_ones_define() -> None:
    program = "import math\nfrom os import (\n    path,\n)\nclass Ball:\n    size = 1\nball = Ball()\n"
    assert definitions(program) == ["import math", "from os import path", "class Ball:\n    size = 1"]
