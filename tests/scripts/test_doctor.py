"""`haustra doctor` tells the truth."""

import json

import pytest

from haustra.envs.view.picture.backends import BACKENDS, best_backend, probe_backends
from haustra.scripts.doctor import Doctor


def test_report_is_json_and_complete() -> None:
    report = json.loads(json.dumps(Doctor()()))
    assert report["versions"]["mujoco"].startswith("3.17")
    assert report["rendering"]["software"] == "works"
    assert set(report["rendering"]) == {"software", *BACKENDS}
    assert report["backends"]["native"].startswith("works")
    assert all(report["rendering"].values()), "a back-end that fails says why"


def test_a_backend_is_chosen_only_when_it_works(monkeypatch: pytest.MonkeyPatch) -> None:
    verdicts = probe_backends()
    for name in BACKENDS:
        monkeypatch.setenv("MUJOCO_GL", name)
        assert best_backend() == (name if verdicts[name] == "works" else None)
