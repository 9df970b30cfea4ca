"""Recordings as a Minari data set, whose environment repeats every episode to the bit."""

import os
import shutil
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from haustra.envs.console.env import action_space, observation_space, observed, observed_names, paid
from haustra.envs.console.recording import COLON, Recording
from haustra.errors import InvalidOptionError, MissingDependencyError, OutputError

_ROOT = "MINARI_DATASETS_PATH"
ENV = "Haustra/Drive-v0"


def export_minari(recordings: Sequence[Recording], dataset: str, root: Path | None = None) -> dict[str, Any]:
    """Write recordings as episodes of one data set.

    Args:
        recordings: of one vehicle in one colon; seeds may differ.
        dataset: its name, such as 'haustra/drive-v0'.
        root: folder of data sets, as MINARI_DATASETS_PATH names it; the user's own when None.

    Raises:
        InvalidOptionError: when recordings are of several vehicles or colons, or the name is taken.
        MissingDependencyError: without Minari.
    """
    try:
        import minari
        from minari.data_collector import EpisodeBuffer
        from minari.storage import get_dataset_path
    except ImportError as error:
        raise MissingDependencyError("Minari data sets need 'pip install haustra[formats]'.") from error
    first = recordings[0]
    for one in recordings:
        alike = _unseeded(one) == _unseeded(first)
        same = one.about["provenance"]["inputs"]["colon"] == first.about["provenance"]["inputs"]["colon"]
        if not (alike and same):
            raise InvalidOptionError(f"'{one.folder}' is of another vehicle or colon than '{first.folder}'.")
    with _root(root), warnings.catch_warnings():
        place = Path(get_dataset_path("")) if root is None else root
        kept = place / "haustra-colons" / str(first.about["provenance"]["inputs"]["colon"])
        try:
            if not kept.exists():
                shutil.copytree(first.folder / COLON, kept)
        except OSError as error:
            raise OutputError(f"Cannot write '{kept}': {error.strerror or error}.") from error
        env = _Standing(first, str(kept.resolve()))
        buffers = [_episode(EpisodeBuffer, number, one) for number, one in enumerate(recordings)]
        try:
            # It advises to name authors and permalinks: advice for those who publish, not for those who export.
            warnings.simplefilter("ignore", UserWarning)
            made = minari.create_dataset_from_buffers(
                dataset,
                buffers,
                env=env,
                algorithm_name=str(first.about["driver"]),
                author="haustra",
                description="Observations: " + ", ".join(observed_names(_row(first, 0))),
                data_format="hdf5",
            )
        except ValueError as error:
            raise InvalidOptionError(f"Minari refuses '{dataset}': {error}") from error
        return {"dataset": dataset, "episodes": made.total_episodes, "steps": made.total_steps, "root": str(place)}


@contextmanager
def _root(root: Path | None) -> Iterator[None]:
    before = os.environ.get(_ROOT)
    if root is not None:
        os.environ[_ROOT] = str(root)
    try:
        yield
    finally:
        if root is not None:
            os.environ.pop(_ROOT, None)
            if before is not None:
                os.environ[_ROOT] = before


class _Standing(gymnasium.Env):
    """What Minari asks of the environment that a recording repeats in, without making one."""

    def __init__(self, recording: Recording, colon: str) -> None:
        about: dict[str, Any] = {"colon": colon, "configuration": dict(recording.about["vehicle"])}
        self.spec = EnvSpec(
            ENV, entry_point="haustra.envs.console.env:DriveEnv", kwargs=about, disable_env_checker=True
        )
        limits = [*recording.about["levers"], *recording.about["conditions"]]
        self.action_space = action_space([(one["low"], one["high"]) for one in limits])
        self.observation_space = observation_space(_row(recording, 0))


def _unseeded(recording: Recording) -> dict[str, Any]:
    return {name: value for name, value in recording.about["vehicle"].items() if name not in ("seed", "policy")}


def _row(recording: Recording, step: int) -> dict[str, Any]:
    """What a look said then: what was asked belongs to the hand."""
    own = ("step", "levers", "asked", "proposed", "by_person", "assisted", "conditions")
    return {name: values[step] for name, values in recording.rows.items() if name not in own}


def _episode(kind: Any, number: int, recording: Recording) -> Any:
    rows = recording.rows
    count = len(rows["step"])
    actions = np.concatenate([rows["levers"], rows["conditions"]], axis=1)[1:]
    length, best = float(recording.about["length"]), float(rows["tip_arc"][0])
    rewards, ends, observations = [], [], [observed(_row(recording, 0))]
    for step in range(1, count):
        row = _row(recording, step)
        reward, ended = paid(row, best, length)
        best = max(best, float(row["tip_arc"]))
        rewards.append(reward)
        ends.append(ended)
        observations.append(observed(row))
    cut = np.zeros(count - 1, bool)
    cut[-1] = not ends[-1]
    return kind(
        id=number,
        seed=int(recording.about["seed"]),
        observations=np.array(observations),
        actions=actions.astype(float),
        rewards=rewards,
        terminations=ends,
        truncations=[bool(one) for one in cut],
        infos={"digest": rows["digest"], "seed": np.full(count, int(recording.about["seed"]))},
    )
