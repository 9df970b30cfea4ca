"""The command line as a shell sees it."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("arguments", [["doctor", "--json"], ["doctor"], ["bench", "episodes", "--help"]])
def test_a_reader_that_goes_away_is_no_error(arguments: list[str]) -> None:
    """As in `haustra doctor | head -0`: nothing on stderr, exit code 0."""
    command = [sys.executable, "-m", "haustra.scripts.main", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
    assert said == b""
    assert process.returncode == 0
