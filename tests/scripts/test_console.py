"""What a person is shown is what was found."""

import pytest

from haustra.scripts.console import summary


def test_brackets_in_names_and_values_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    summary({"backends": {"warp": "not installed: pip install 'haustra[warp]'"}, "a [b]": "[/c]"})
    shown = capsys.readouterr().out
    assert "haustra[warp]" in shown
    assert "a [b]" in shown and "[/c]" in shown
