"""Learning curves of several seeds: read, put on one grid, drawn, and refused where a mean would say nothing."""

import json
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.learning.curve import COLUMNS, EPISODE, WITHDRAWAL_EPISODE, Curve, read_curve, seed_curves
from haustra.errors import UnreadableFileError
from haustra.scripts.main import BAD_INPUT, SUCCESS, main


def write_run(folder: Path, seed: int, rows: np.ndarray, **training) -> Path:
    folder.mkdir()
    (folder / "training.json").write_text(json.dumps({"seed": seed, "algorithm": "ppo", **training}))
    lines = [",".join(COLUMNS), *(",".join(map(str, row)) for row in rows.tolist())]
    (folder / "curve.csv").write_text("\n".join(lines) + "\n")
    return folder


def rising(slope: float, *, last: int, every: int) -> np.ndarray:
    """Rows whose progress is `slope` times the steps, of 20 episodes each."""
    steps = np.arange(every, last + 1, every)
    return np.stack([steps, 20 + 0 * steps, steps, slope * steps, *np.zeros((len(COLUMNS) - 4, len(steps)))], axis=1)


@pytest.fixture
def runs(tmp_path) -> list[Path]:
    """Three seeds, of different length and different rows."""
    lasts, everies = (10_000, 12_000, 16_000), (100, 150, 400)
    return [
        write_run(tmp_path / str(seed), seed, rising((4 + seed) * 1e-5, last=lasts[seed], every=everies[seed]))
        for seed in range(3)
    ]


def test_seeds_are_compared_at_the_same_steps(runs):
    found = seed_curves([read_curve(run / "curve.csv") for run in runs])
    assert found.steps[-1] == 10_000 and len(found.steps) == 40
    middle = found.steps - found.steps[0] / 2
    for slope, run in zip((4e-5, 5e-5, 6e-5), found.columns["progress"], strict=True):
        assert run == pytest.approx(slope * middle, abs=slope * 400)  # rows lie up to 400 steps apart


def test_rows_count_by_their_episodes():
    rest = [0.0] * (len(COLUMNS) - 4)
    few, many = [100.0, 10.0, 0.0, 1.0, *rest], [200.0, 30.0, 0.0, 0.0, *rest]
    one: dict[str, np.ndarray] = dict(zip(COLUMNS, np.array([few, many]).T, strict=True))
    short = {name: values[-1:] for name, values in one.items()}
    assert seed_curves([one, short]).columns["progress"].tolist() == [[0.25], [0.0]]


def test_the_figure_and_where_the_runs_stand(runs, tmp_path, capsys):
    figure = tmp_path / "figures" / "curves.png"
    assert main(["train", "curves", *map(str, runs), "-o", str(figure), "--json"]) == SUCCESS
    printed = json.loads(capsys.readouterr().out)
    assert printed["seeds"] == [0, 1, 2] and printed["steps"] == 10_000
    low, high = printed["progress"]["range"]
    assert low < printed["progress"]["mean"] == pytest.approx(0.5, abs=0.02) and high == pytest.approx(0.6, abs=0.02)
    assert figure.stat().st_size > 5000


def test_runs_without_a_common_mean_are_refused_in_one_line(runs, tmp_path, capsys):
    rows = rising(1e-5, last=1000, every=100)
    other = write_run(tmp_path / "sac", 7, rows, algorithm="sac")
    twin = write_run(tmp_path / "twin", 0, rows)
    for folder, words in ((other, "differ in algorithm"), (twin, "same seed"), (tmp_path, "no training")):
        call = ["train", "curves", str(runs[0]), str(folder), "-o", str(tmp_path / "curves.png")]
        assert main(call) == BAD_INPUT
        assert words in capsys.readouterr().err.strip().splitlines()[-1]


@pytest.mark.parametrize("text", ["", "steps,episodes\n1,2\n", ",".join(COLUMNS) + "\n", "{}", "\0"])
def test_rubbish_is_no_curve(text, tmp_path):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(UnreadableFileError, match="curve"):
        read_curve(tmp_path / "curve.csv")
    header = ",".join(COLUMNS)
    for rows in (
        "5,2,0,0,0,0,0,0,0\n4,2,0,0,0,0,0,0,0",
        "5,2,0,nan,0,0,0,0,0",
        "5,2,0,much,0,0,0,0,0",
        "5,2,0,0,0,0,0",
    ):
        (tmp_path / "curve.csv").write_text(f"{header}\n{rows}\n")
        with pytest.raises(UnreadableFileError, match="no learning curve"):
            read_curve(tmp_path / "curve.csv")


def test_a_training_that_goes_on_writes_no_steps_twice(tmp_path):
    """Rows of steps behind the checkpoint are of a run that was interrupted there: they are done again."""
    path = tmp_path / "curve.csv"
    first = Curve(path, steps=0, episodes_a_row=2)
    for steps in (10, 20, 30):
        first.add(steps, [[0.0] * len(EPISODE)] * 2)
    again = Curve(path, steps=20, episodes_a_row=2)
    again.add(25, [[1.0] * len(EPISODE)] * 2)
    rows = read_curve(path)
    assert rows["steps"].tolist() == [10, 20, 25] and rows["return"].tolist() == [0.0, 0.0, 1.0]
    Curve(path, steps=0)
    assert path.read_text() == ",".join(COLUMNS) + "\n"


def test_the_curve_of_a_withdrawal_tells_what_was_seen(tmp_path):
    curve = Curve(tmp_path / "curve.csv", steps=0, episodes_a_row=1, episode=WITHDRAWAL_EPISODE)
    assert curve.add(10, [[0.0] * len(EPISODE) + [0.9]])["coverage"] == 0.9
    assert read_curve(tmp_path / "curve.csv")["coverage"].tolist() == [0.9]
