"""Devices side by side: the same patients, paired differences, and nothing lost when it is stopped."""

import json
import sqlite3
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.study import compare, store
from haustra.envs.study.compare import comparison
from haustra.envs.study.compare_passage import CompareOptions, scope_options
from haustra.envs.study.compare_patients import FRICTION, WALL_STIFFNESS, Patient, patients
from haustra.envs.study.compare_table import paired_interval, summarise
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.view.report.compare_report import report_comparison
from haustra.errors import InvalidDesignError, InvalidOptionError, UnreadableFileError
from haustra.models.anatomy.colon import Colon
from haustra.models.presets import preset_of
from haustra.scripts.main import BAD_INPUT, SUCCESS, main
from tests.tube_colon import straight_tube


def test_patients_are_a_latin_hypercube():
    """Each quarter of each range holds one of four."""
    four = patients("quick")
    for name, (low, high) in (("friction", FRICTION), ("wall_stiffness", WALL_STIFFNESS)):
        quarters = [int(4 * (getattr(one, name) - low) / (high - low)) for one in four]
        assert sorted(quarters) == [0, 1, 2, 3]
    assert patients("quick") == four and not {one.seed for one in four} & {one.seed for one in patients("standard")}


def test_what_cannot_be_compared_is_refused(tmp_path, capsys):
    with pytest.raises(InvalidOptionError, match="Give two or more devices, each once"):
        comparison(["capsule"], "smoke")
    with pytest.raises(InvalidOptionError, match="Two devices are called 'adult'"):
        comparison(["adult", _copy(tmp_path)], "smoke")
    with pytest.raises(InvalidDesignError, match="Device 'broom' is not known"):
        comparison(["capsule", "broom"], "smoke")
    assert main(["compare", "capsule", "vine", "--cohort", "none", "-o", str(tmp_path / "out")]) == BAD_INPUT
    assert "Cohort 'none' is not known" in capsys.readouterr().err


def _copy(folder) -> str:
    from haustra.models.devices.scope.files import save_design
    from haustra.models.devices.scope.library import named_design

    return str(save_design(named_design("adult"), folder / "adult.toml"))


def test_a_scope_is_modelled_as_it_is_run():
    """Joints twice as far apart press up to twice as hard."""
    options = scope_options(patients("smoke")[1])
    assert (preset_of(options), options.wall_law, options.mesentery) == ("balanced", "table", True)
    assert (options.friction, options.wall_stiffness) == (
        patients("smoke")[1].friction,
        patients("smoke")[1].wall_stiffness,
    )


def test_an_interval_is_students():
    """Mean 2 with deviation 1 of four: 2 -+ 3.182 / 2."""
    found = paired_interval(np.array([1.0, 1.0, 3.0, 3.0]) / 1.0)
    half = 3.182446 * np.std([1, 1, 3, 3], ddof=1) / 2
    assert found == pytest.approx((2.0, 2.0 - half, 2.0 + half), rel=1e-5)
    assert paired_interval(np.array([1.5])) == (1.5, None, None)


def test_pairs_are_of_the_same_patients():
    """What only one device has of a patient does not count."""
    rows = [
        {
            "device": device,
            "patient": patient,
            "reach": reach,
            "outcome": "stuck",
            "pain_site": "none",
            "mesentery": 1.0,
        }
        for device, patient, reach in (
            ("a", "p0", 0.5),
            ("a", "p1", 0.7),
            ("a", "p2", 0.1),
            ("b", "p0", 0.6),
            ("b", "p1", 1.0),
        )
    ]
    told = summarise(rows, ["a", "b"])
    assert [one["reach_mean"] for one in told["devices"]] == pytest.approx([1.3 / 3, 0.8])
    pair = next(pair for pair in told["pairs"] if pair["score"] == "reach")
    assert (pair["first"], pair["second"], pair["patients"]) == ("a", "b", 2)
    assert pair["difference"] == pytest.approx(0.2) and pair["low"] < 0.2 < pair["high"]
    assert next(pair for pair in told["pairs"] if pair["score"] == "pain")["difference"] is None


def test_stopped_half_way_it_goes_on_without_loss(tmp_path, monkeypatch):
    """The second session computes only what the first had not, and what is told is what one session tells."""
    tube = straight_tube(0.2)
    monkeypatch.setattr(compare, "patient_named", lambda name: replace(_Tube(name, 0, 0.05, 1500.0), tube=tube))
    monkeypatch.setattr(compare, "draw", lambda run, patient, path: None)
    study = comparison(["capsule", "inchworm"], "smoke", CompareOptions(seconds=0.2))
    told = []
    for folder, sessions in ((tmp_path / "whole", (4,)), (tmp_path / "halves", (3, 4))):
        for claimed in sessions:
            with store.open_store(
                folder, study, lambda: jobs_of(study, designs_of(study)), kind="sweep", resume=True
            ) as kept:
                kept.begin_session(backend="native", pool="here")
                jobs = kept.claim(claimed)
                assert len(jobs) == (1 if len(sessions) == 2 and claimed == 4 else claimed)
                for result in compare.NATIVE.start(study, folder)(jobs):
                    assert result.state == "finished", result.reason
                    kept.record(result)
        told.append(compare.compared(folder))
    assert told[0] == told[1] and not told[0]["lost"]
    wanted = {"name", "intubation", "reach_mean", "wall_force_peak_mean_N", "mesentery_extension_mean_mm"}
    wanted |= {"p_perforation_mean", "pain_mean", "stopped_by"}
    assert all(wanted <= set(one) for one in told[0]["devices"])
    assert all({"first", "second", "score", "difference", "low", "high"} <= set(pair) for pair in told[0]["pairs"])
    files = report_comparison(tmp_path / "whole", told[0])
    page = Path(files["report"]).read_text(encoding="utf-8")
    assert all(part in page for part in ("Lumen widths in which they work", "mucosa seen on the way", "Pain by site"))
    for path in files.values():
        assert Path(path).stat().st_size > 100, path


@pytest.mark.thorough
def test_killed_it_goes_on_without_loss(tmp_path, capsys):
    """The process is killed while it computes its second run; all that is told is what one that lived tells."""

    def asked(folder: str) -> list[str]:
        own = ["--seconds", "2", "--workers", "1", "--resume", "--json", "-o", str(tmp_path / folder)]
        return ["compare", "capsule", "inchworm", "--cohort", "smoke", *own]

    running = subprocess.Popen([sys.executable, "-m", "haustra.scripts.main", *asked("killed")], stdout=subprocess.PIPE)
    while running.poll() is None and _finished(tmp_path / "killed") < 1:
        time.sleep(0.02)
    running.kill()
    running.communicate()
    assert 1 <= _finished(tmp_path / "killed") < 4
    told = []
    for folder in ("killed", "whole"):
        assert main(asked(folder)) == SUCCESS
        told.append(json.loads(capsys.readouterr().out))
        assert sorted(path.name for path in (tmp_path / folder / "pictures").iterdir()) == [
            f"{name}{end}" for name in ("capsule", "inchworm") for end in ("-close.png", ".png", ".webp")
        ]
    assert all(told[0][name] == told[1][name] for name in ("devices", "pairs", "lost"))


def _finished(folder: Path) -> int:
    try:
        with store.read_store(folder) as kept:
            return kept.counts()["finished"]
    except (UnreadableFileError, sqlite3.Error):
        return 0


@dataclass(frozen=True)
class _Tube(Patient):
    tube: Colon | None = None

    @property
    def colon(self) -> Colon:
        assert self.tube
        return self.tube
