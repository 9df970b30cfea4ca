"""Processes that compute beside their parent: on one thread each, and gone with it."""

import os
import signal
import subprocess
import sys

import pytest

from haustra.children import ONE_THREAD, children

_PARENT = """
import time
from haustra.children import children

if __name__ == "__main__":
    with children(2) as pool:
        waiting = [pool.submit(time.sleep, 0.2) for _ in range(4)]
        [each.result() for each in waiting]
        print("ready", flush=True)
        [each.result() for each in [pool.submit(time.sleep, 600) for _ in range(4)]]
"""


def _asked() -> dict[str, str | None]:
    return {name: os.environ.get(name) for name in ONE_THREAD}


def test_each_has_one_thread_of_libraries_and_the_parent_keeps_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = _asked()
    with children(1) as pool:
        assert pool.submit(_asked).result() == ONE_THREAD
    assert _asked() == before


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_nothing_is_left_of_a_parent_that_is_killed(tmp_path, how: signal.Signals) -> None:
    """Whoever reads what it printed sees the end: no child holds the other end open."""
    script = tmp_path / "parent.py"
    script.write_text(_PARENT, encoding="utf-8")
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None and parent.stdout.readline() == "ready\n"
        parent.send_signal(how)
        rest, _ = parent.communicate(timeout=30)
    assert rest == "" and parent.returncode == -how
