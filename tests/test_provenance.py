"""Results say what computed them: the backend, the device that it ran on, and the versions of what it ran with."""

import json
import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from haustra import provenance
from haustra.envs.runs.device_run import run_device
from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.measure.scores import provenance_of
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.study.export import export
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.store import open_store
from haustra.envs.study.study import Result
from haustra.envs.view.device_folder import write_device_run
from haustra.models.device_scene import device_options
from haustra.models.devices.base import load_device
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.provenance import backend_record
from tests.envs.study.studies import study
from tests.tube_colon import straight_tube

COMPUTES_WITH = {
    "native": {"mujoco"},
    "linear": {"mujoco", "llvmlite"},
    "linear-gpu": {"mujoco", "llvmlite"},
    "warp": {"mujoco", "jax", "jaxlib", "mujoco-mjx", "warp-lang"},
}
"""Packages that a row of a backend depends on."""


@pytest.fixture
def h100(monkeypatch: pytest.MonkeyPatch):
    """JAX as it is where there is a GPU, and every package installed."""
    device = SimpleNamespace(platform="gpu", device_kind="NVIDIA H100")
    monkeypatch.setitem(sys.modules, "jax", SimpleNamespace(devices=lambda: [device]))
    monkeypatch.setattr(provenance, "_version", lambda name: f"1.0 of {name}")
    provenance._jax_device.cache_clear()
    yield
    provenance._jax_device.cache_clear()


@pytest.mark.usefixtures("h100")
@pytest.mark.parametrize("backend", COMPUTES_WITH)
def test_a_backend_is_named_with_its_device_and_all_that_it_computes_with(backend: str) -> None:
    record = backend_record(backend)
    kind = "gpu" if backend in ("linear-gpu", "warp") else "cpu"
    assert record.pop("backend") == backend and record.pop("device").startswith(kind)
    assert record == {name: f"1.0 of {name}" for name in COMPUTES_WITH[backend]}


@pytest.mark.parametrize("make", [NativeEngine, LinearSingle])
def test_a_run_of_a_scope_names_what_stepped_it(make) -> None:
    law = "planes" if make is NativeEngine else "table"
    options = SceneOptions(
        wall_law=law, softening=False, insertion_limit=0.3, shaft_cell=0.0625, bending_cell=0.034, twist_hinges=2
    )
    scene = build_scene(straight_tube(), None, named_design("adult"), options, show_lumen=False)
    found = provenance_of(scene, run_insertion(scene, seconds=0.1, backend=make)).to_json()
    assert found["backend"] == backend_record(make.name)
    assert found["versions"]["mujoco"] == found["backend"]["mujoco"] == version("mujoco")
    assert found["versions"]["haustra"] == version("haustra")


def test_a_run_of_any_device_names_what_stepped_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = {"outside": np.zeros((2, 2, 3), np.uint8)}
    monkeypatch.setattr("haustra.envs.view.device_folder.end_pictures", lambda run: picture)
    device, colon = load_device("capsule"), straight_tube(0.2)
    scores = write_device_run(tmp_path, colon=colon, run=run_device(device, colon, device_options(device), seconds=0.1))
    assert scores["provenance"]["backend"] == backend_record(scores["backend"])
    assert json.loads((tmp_path / "scores.json").read_text())["provenance"]["backend"]["device"].startswith("cpu")


@pytest.mark.usefixtures("h100")
@pytest.mark.parametrize("backend", COMPUTES_WITH)
def test_each_row_of_a_study_leads_to_what_computed_it(backend: str, tmp_path: Path) -> None:
    """A study that one machine began and another ended has a record of each, and rows say which is theirs."""
    asked = study()
    with open_store(tmp_path, asked, lambda: jobs_of(asked, designs_of(asked)), kind="sweep", resume=False) as store:
        for name in ("native", backend):
            store.begin_session(backend=name, pool="here")
            (job,) = store.claim(1)
            store.record(Result(job.id, "finished", {"force_N": 1.0, "ripple_fraction": 0.0}))
        export(store)
        rows = [row for row in store.rows() if row["state"] == "finished"]
        sessions = {session["id"]: session for session in store.sessions()}
    for row, name in zip(rows, ("native", backend), strict=True):
        made = sessions[row["session"]]
        assert made["backend"] == name and made["versions"].items() >= backend_record(name).items()
        assert made["versions"].keys() >= {"haustra", "python", "mujoco", "numpy"}
    written = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))["sessions"]
    assert written == list(sessions.values())
