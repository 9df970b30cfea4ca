"""A scope that is pulled out comes out, and its camera has seen some of the colon, not all of it."""

from haustra.envs.runs.outcome import Outcome
from haustra.envs.runs.treatment import Treatment
from haustra.envs.runs.withdrawal import insert_and_withdraw
from haustra.envs.view.dataset.moments import Source
from haustra.envs.view.inspect import write_inspection


def test_a_withdrawal_is_inspected(source: Source, tmp_path):
    scene = source.scene
    tool = Treatment(scene, "snare")
    inserted, out = insert_and_withdraw(scene, seconds=5.0, rate=0.03, treatment=tool)
    assert out.outcome is Outcome.WITHDRAWN
    assert out.trajectory.time[0] > inserted.trajectory.time[-1]
    assert out.trajectory.insertion[-1] < 0.04 < out.trajectory.insertion[0]
    scores = write_inspection(tmp_path, scene, out)
    assert 0.02 < scores["mucosa_seen"] < 0.9
    assert scores["mucosa_seen_by_site"]["sigmoid"] > 0.02
    assert scores["polyps"] == 1 and scores["blind_spots"] >= 1
    assert scores["withdrawal_outcome"] == "withdrawn"
    assert (tmp_path / "inspection.png").is_file() and (tmp_path / "withdrawal.npz").is_file()
    (event,) = tool.events
    assert event.taken and event.lesion == 0 and event.reason == "reached"
    assert event.bleeding_mm2 > 70 and not tool.after().lesions
