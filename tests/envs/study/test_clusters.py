"""One study's jobs through Slurm and Ray give the same table as here."""

import os
import warnings
from pathlib import Path

import pytest

from haustra.envs.study.export import export
from haustra.envs.study.on_slurm import slurm_map
from haustra.envs.study.run import Computing, answer_all, run_sweep
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.store import open_store
from haustra.envs.study.worker import order
from haustra.errors import InvalidOptionError
from tests.envs.study.studies import study


def _table(folder: Path, job_map) -> bytes:
    asked = study()
    with open_store(folder, asked, lambda: jobs_of(asked, designs_of(asked)), kind="sweep", resume=False) as store:
        store.begin_session(backend="native", pool="test")
        answer_all(store, job_map)
        export(store)
    return (folder / "results.csv").read_bytes()


def test_submitit_gives_the_same_table(tmp_path: Path) -> None:
    pytest.importorskip("submitit")
    asked = order(study(), "native", tmp_path)
    (tmp_path / "there").mkdir()
    with slurm_map(asked, folder=tmp_path / "there", workers=2, batch=1, cluster="local") as answer:
        there = _table(tmp_path / "there", answer)
    run_sweep(study(), tmp_path / "here", Computing(workers=1))
    assert there == (tmp_path / "here" / "results.csv").read_bytes()


def test_without_slurm_it_says_so(tmp_path: Path) -> None:
    pytest.importorskip("submitit")
    with pytest.raises(InvalidOptionError, match="Slurm cannot be used"):
        run_sweep(study(), tmp_path, Computing(on="slurm"))


@pytest.mark.slow
@pytest.mark.skipif(
    "HAUSTRA_TEST_RAY" not in os.environ, reason="Ray starts in 15 s, takes 1 GB, opens ports: HAUSTRA_TEST_RAY=1"
)
def test_ray_gives_the_same_table(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Ray's own
        run_sweep(study(), tmp_path / "there", Computing(workers=2, on="ray"))
    run_sweep(study(), tmp_path / "here", Computing(workers=2))
    assert (tmp_path / "there" / "results.csv").read_bytes() == (tmp_path / "here" / "results.csv").read_bytes()
