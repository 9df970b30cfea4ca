"""What other programs are given: Minari's episodes repeat to the bit, LeRobot's conventions hold, films play."""

import json
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.console.film import SIDE
from haustra.envs.console.recording import load_recording
from haustra.scripts.main import BAD_INPUT, SUCCESS, main


@pytest.fixture(scope="module")
def episodes(colon_folder, tmp_path_factory) -> Path:
    """Two episodes of the follower in the task."""
    folder = tmp_path_factory.mktemp("episodes")
    call = ["record", "--colon", str(colon_folder), "--task", "insertion", "--fixed", "--episodes", "2"]
    assert main([*call, "--seconds", "1", "--seed", "5", "-o", str(folder), "--json"]) == SUCCESS
    return folder


@pytest.fixture(scope="module")
def keys(colon_folder, tmp_path_factory) -> Path:
    """A script of keys."""
    folder = tmp_path_factory.mktemp("keys")
    script = [
        {"at": 0, "hand": {"push": 1, "left": -0.5}},
        {"at": 0.5, "hand": {"gas": 1}, "change": {"friction": 0.2}},
    ]
    (folder / "keys.json").write_text(json.dumps(script))
    call = ["record", "--colon", str(colon_folder), "--device", "paediatric", "--preset", "fast", "--seconds", "1"]
    assert main([*call, "--driver", str(folder / "keys.json"), "-o", str(folder / "drive"), "--json"]) == SUCCESS
    return folder / "drive"


def test_a_script_of_keys_is_repeated_to_the_bit(keys, capsys):
    assert main(["replay", str(keys), "--check", "--json"]) == SUCCESS
    assert json.loads(capsys.readouterr().out)["exact"]


@pytest.fixture(scope="module", params=["follower's task", "keys", "endoscopist", "capsule", "policy"])
def recorded(request, colon_folder, tmp_path_factory) -> Path:
    """What each kind of driver has recorded."""
    if request.param in ("follower's task", "keys"):
        return request.getfixturevalue({"follower's task": "episodes"}.get(request.param, request.param))
    how = {
        "endoscopist": ["--device", "paediatric", "--preset", "fast", "--driver", "endoscopist"],
        "capsule": ["--device", "capsule"],
        "policy": ["--driver", "insertion-easy"],
    }[request.param]
    folder = tmp_path_factory.mktemp("recorded") / "drive"
    call = ["record", "--colon", str(colon_folder), *how, "--seconds", "1", "-o", str(folder), "--json"]
    assert main(call) == SUCCESS
    return folder


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_episodes_of_minari_repeat_to_the_bit(recorded, tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    name, several = "haustra/driven-v0", not (recorded / "recording.json").exists()
    export = ["export", str(recorded), "--to", "minari", "--name", name, "-o", str(tmp_path), "--json"]
    assert main(export) == SUCCESS
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    dataset = minari.load_dataset(name)
    assert dataset.total_episodes == (2 if several else 1)
    env = dataset.recover_environment(disable_env_checker=True)
    for episode in dataset.iterate_episodes():
        assert len(episode.actions) >= 8
        assert np.abs(episode.actions).max() > 0, "nobody drove"
        seen, info = env.reset(seed=int(episode.infos["seed"][0]))
        for step, action in enumerate(episode.actions):
            np.testing.assert_array_equal(seen, episode.observations[step])
            assert info["digest"] == episode.infos["digest"][step]
            seen, reward, ended, _, info = env.step(action)
            assert (reward, ended) == (episode.rewards[step], episode.terminations[step])
        np.testing.assert_array_equal(seen, episode.observations[-1])
    env.close()
    assert main(export) == BAD_INPUT, "a name is taken once"


def test_the_layout_of_lerobot_holds(episodes, tmp_path):
    """What the reader of LeRobotDataset v3.0 looks up, by the names it uses."""
    parquet = pytest.importorskip("pyarrow.parquet")
    av = pytest.importorskip("av")
    out = tmp_path / "dataset"
    assert main(["export", str(episodes), "--to", "lerobot", "-o", str(out), "--size", "32", "--json"]) == SUCCESS
    info = json.loads((out / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0" and info["fps"] == 10 and info["splits"] == {"train": "0:2"}
    rows = parquet.read_table(out / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(rows.column_names) == set(info["features"]) - {"observation.images.endoscope"}
    assert len(rows) == info["total_frames"]
    for name, about in info["features"].items():
        if about["dtype"] != "video" and about["shape"] != [1]:
            assert rows.schema.field(name).type.list_size == about["shape"][0] == len(about["names"])
    assert rows["index"].to_pylist() == list(range(len(rows)))
    meta = parquet.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for episode in meta:
        span = slice(episode["dataset_from_index"], episode["dataset_to_index"])
        assert rows["episode_index"].to_pylist()[span] == [episode["episode_index"]] * episode["length"]
        assert rows["timestamp"].to_numpy()[span] == pytest.approx(np.arange(episode["length"]) / 10)
        key = "videos/observation.images.endoscope"
        assert episode[f"{key}/to_timestamp"] - episode[f"{key}/from_timestamp"] == pytest.approx(
            episode["length"] / 10
        )
    tasks = parquet.read_table(out / "meta/tasks.parquet").to_pandas() if _has_pandas() else None
    assert tasks is None or tasks.iloc[0]["task_index"] == 0
    assert set(json.loads((out / "meta/stats.json").read_text())) >= {"action", "observation.state"}
    place = info["video_path"].format(video_key="observation.images.endoscope", chunk_index=0, file_index=0)
    with av.open(str(out / place)) as film:
        assert sum(1 for _ in film.decode(video=0)) == info["total_frames"]


def _has_pandas() -> bool:
    from importlib.util import find_spec

    return find_spec("pandas") is not None


@pytest.mark.parametrize("kind", ["mp4", "gif"])
@pytest.mark.parametrize(("fps", "speed", "frames"), [(2.0, 1.0, 3), (4.0, 2.0, 3)])
def test_a_film_shows_the_drive(kind, fps, speed, frames, keys, tmp_path, capsys):
    """A recording keeps numbers, no pictures: a film is drawn from them, and lasts as long as what it shows."""
    path = tmp_path / f"film.{kind}"
    call = ["export", str(keys), "--to", kind, "--fps", str(fps), "--speed", str(speed), "-o", str(path), "--json"]
    assert main(call) == SUCCESS
    said = json.loads(capsys.readouterr().out)
    pictures, seconds = {"mp4": _read_mp4, "gif": _read_gif}[kind](path)
    assert len(pictures) == said["pictures"] == frames
    assert seconds == pytest.approx(said["seconds"]) and seconds == pytest.approx(frames / fps)
    assert {one.shape for one in pictures} == {(SIDE + 24, 2 * SIDE, 3)}, "two squares, and a line below them"
    for side in (slice(None, SIDE), slice(SIDE, None)):  # what the tip sees, and the colon from outside
        first, last = (one[:SIDE, side].astype(int) for one in (pictures[0], pictures[-1]))
        assert np.ptp(first) > 100, "nothing is drawn"
        assert np.abs(first - last).max() > 40, "nothing moved"


def _read_mp4(path: Path) -> tuple[list[np.ndarray], float]:
    """Pictures of a film, and how long it lasts [s]."""
    av = pytest.importorskip("av")
    with av.open(str(path)) as film:
        (stream,) = film.streams
        assert (stream.type, stream.codec_context.name, stream.codec_context.pix_fmt) == ("video", "h264", "yuv420p")
        frames = list(film.decode(video=0))
        assert [one.time for one in frames] == pytest.approx(np.arange(len(frames)) / float(stream.average_rate))
        return [one.to_ndarray(format="rgb24") for one in frames], float(stream.duration * stream.time_base)


def _read_gif(path: Path) -> tuple[list[np.ndarray], float]:
    from PIL import Image, ImageSequence

    with Image.open(path) as film:
        assert film.info["loop"] == 0, "it begins again and again"
        frames = [(np.asarray(one.convert("RGB")), one.info["duration"]) for one in ImageSequence.Iterator(film)]
    return [picture for picture, _ in frames], sum(duration for _, duration in frames) / 1000


@pytest.mark.parametrize("pictures", [True, False])
def test_lerobot_is_given_a_film_unless_it_is_to_be_without(pictures, episodes, tmp_path):
    av, out = pytest.importorskip("av"), tmp_path / "dataset"
    call = ["export", str(episodes), "--to", "lerobot", "-o", str(out), "--size", "32", "--json"]
    assert main(call if pictures else [*call, "--no-pictures"]) == SUCCESS
    info = json.loads((out / "meta/info.json").read_text())
    films = list(out.rglob("*.mp4"))
    assert len(films) == pictures == any(one["dtype"] == "video" for one in info["features"].values())
    for path in films:
        with av.open(str(path)) as film:
            frames = list(film.decode(video=0))
            assert {(one.width, one.height) for one in frames} == {(32, 32)}
            assert len(frames) == info["total_frames"]
            stream = film.streams.video[0]
            assert float(stream.duration * stream.time_base) == pytest.approx(info["total_frames"] / info["fps"])


def test_what_cannot_be_done_is_one_line(episodes, keys, tmp_path, capsys):
    for call, said in (
        (["export", str(episodes), "--to", "mp4"], "holds 2 recordings"),
        (["export", str(keys), "--to", "gif", "-o", str(tmp_path / "film.mp4")], "does not end in .gif"),
        (["export", str(tmp_path), "--to", "minari"], "holds no recording"),
        (["replay", str(keys), str(keys), "--check"], "2 recordings were named"),
        (["record", "--colon", str(tmp_path), "--device", "capsule", "--posture", "left", "-o", str(tmp_path / "a")],
         "honours neither a preset nor posture"),
    ):  # fmt: skip
        assert main(call) == BAD_INPUT
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1, error


def test_a_demonstration_shows_what_a_learner_sees(episodes):
    one = load_recording(episodes / "episode-0001")
    assert one.about["seed"] == 6 and one.about["vehicle"]["policy"] == "follower"
    assert one.rows["observation"].dtype == np.float32
    assert len(one.rows["observation"]) == len(one.rows["levers"]) == 26


def test_a_policy_learns_from_demonstrations_before_it_learns_from_rewards(episodes, tmp_path):
    """What it does where the driver was is what the driver did, to a third of how much that varies."""
    pytest.importorskip("stable_baselines3")
    from dataclasses import replace

    from haustra.envs.learning.demonstrations import load_demonstrations
    from haustra.envs.learning.policy import load_policy
    from haustra.envs.learning.settings import Training
    from haustra.envs.learning.train import train
    from haustra.envs.tasks.config import TaskConfig
    from haustra.errors import InvalidOptionError
    from tests.task_bank import short_bank

    task = TaskConfig()
    shown = load_demonstrations(episodes, task)
    assert shown.episodes == 2 and shown.done.shape == (50, 4)
    sizes = {
        "steps": 64,
        "leg": 64,
        "worlds": 2,
        "rollout": 16,
        "batch": 32,
        "epochs": 1,
        "layers": (32,),
        "imitate": 0,
    }
    training = Training(task=task, demonstrations=str(episodes), learning_rate=1e-9, **sizes)
    train(training, tmp_path / "trained", bank=short_bank(), threads=1)
    policy = load_policy(tmp_path / "trained")
    value = shown.seen
    for layer, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        value = value @ weight.T + bias
        value = np.tanh(value) if layer < len(policy.weights) - 1 else value
    assert ((value - shown.done) ** 2).mean() < 0.33 * shown.done.var(axis=0).mean()
    with pytest.raises(InvalidOptionError, match="set imitate to 0"):
        replace(training, imitate=10)
    with pytest.raises(InvalidOptionError, match="shows 45 numbers"):
        load_demonstrations(episodes, replace(task, imager=True))
