"""Recordings of a magnetic imager: what is written is read again, by this project and as the public set's code does."""

from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.imager_files import CAECUM, END, START, ImagerRecording, read_recording, write_recording
from haustra.errors import UnreadableFileError


def _recording() -> ImagerRecording:
    random = np.random.default_rng(0)
    time = np.cumsum(random.uniform(0.05, 0.2, 30))
    return ImagerRecording(time - time[0], random.uniform(-0.4, 0.4, (30, 6, 3)), {START: 0.2, CAECUM: 1.5})


def test_a_recording_is_read_as_it_was_written(tmp_path: Path) -> None:
    """To the hundredth of a millimetre and the tenth of a millisecond that the layout holds."""
    written = _recording()
    write_recording(tmp_path, written)
    found = read_recording(tmp_path)
    assert np.abs(found.coils - written.coils).max() < 0.51e-5
    assert np.abs(found.time - written.time).max() < 1.01e-4
    last = float(written.time[-1])
    assert found.events == pytest.approx({START: 0.2, CAECUM: 1.5, END: last}, abs=2e-3)


def test_files_read_as_the_public_set_reads_its_own(tmp_path: Path) -> None:
    """Each line split at semicolons, the last piece dropped; times are milliseconds; the tip comes first, y is down."""
    recording = _recording()
    write_recording(tmp_path, recording)
    lists = {
        axis: [
            [float(cell) for cell in line.strip().split(";")[:-1]]
            for line in (tmp_path / f"{axis}.txt").read_text().splitlines()
        ]
        for axis in "XYZT"
    }
    tip = 1e3 * recording.coils[3, 0]
    assert [lists["X"][3][0], lists["Y"][3][0], lists["Z"][3][0]] == pytest.approx([tip[0], -tip[2], tip[1]], abs=0.01)
    assert lists["T"][3][0] == pytest.approx(1e3 * recording.time[3], abs=0.1)
    events = [line.split(";")[:2] for line in (tmp_path / "LogFile_P.txt").read_text().splitlines()]
    assert [name for _, name in events] == [START, CAECUM, END]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("X.txt", "1;2;3;4;\n1;2;nan;4;\n", "line 2"),
        ("Y.txt", "1;2;3;4;\n1;2;3;\n", "3 numbers, but 4"),
        ("Z.txt", "1e9;2;3;4;\n", "line 1"),
        ("X.txt", "1;2;3;4;\n", "not of one recording"),
        ("T.txt", "0;\n" * 30, "does not rise"),
        ("T.txt", "".join(f"{moment % 20};\n" for moment in range(30)), "line 21: the time does not rise"),
        ("T.txt", "", "is empty"),
        ("X.txt", "1;" * 65, "64 coils"),
        ("LogFile_P.txt", "soon;Endoscopy started;\n", "line 1"),
    ],
)
def test_what_is_damaged_is_refused_in_one_line(name: str, text: str, said: str, tmp_path: Path) -> None:
    write_recording(tmp_path, _recording())
    (tmp_path / name).write_text(text)
    with pytest.raises(UnreadableFileError, match=said) as found:
        read_recording(tmp_path)
    assert "\n" not in str(found.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    write_recording(tmp_path, _recording())
    (tmp_path / "Y.txt").unlink()
    with pytest.raises(UnreadableFileError, match=r"Y\.txt"):
        read_recording(tmp_path)
