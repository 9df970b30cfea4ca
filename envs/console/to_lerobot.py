"""Recordings in the layout of LeRobotDataset v3.0, written without LeRobot: parquet, one film, and JSON beside them."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.env import observed, observed_names
from haustra.envs.console.film import Mp4
from haustra.envs.console.painter import Camera, Eye
from haustra.envs.console.recording import COLON, FRAME_RATE, Recording
from haustra.envs.console.source import glance_at, moment
from haustra.envs.console.to_minari import _row
from haustra.envs.console.vehicles import surroundings
from haustra.errors import InvalidOptionError, MissingDependencyError
from haustra.files import replaced_together, write_json

VERSION = "v3.0"
_CHUNK, _DATA_MB, _VIDEO_MB = 1000, 100, 200
"""What the format asks for: files of a chunk, sizes of files [MB]."""
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_CAMERA = "observation.images.endoscope"
_TASK = "Insert the device as far as the caecum."
_FIRST = {"chunk_index": 0, "file_index": 0}


def export_lerobot(
    recordings: Sequence[Recording],
    folder: Path,
    *,
    size: int = 128,
    pictures: bool = True,
    progress: Callable[[int, int], None] = lambda done, rows: None,
) -> dict[str, Any]:
    """Write recordings as episodes of one data set, ten rows a second.

    Args:
        recordings: of vehicles with the same levers.
        folder: to write into.
        size: rows and columns of the endoscope's pictures [pixels].
        pictures: write them; drawing takes longer than all the rest.
        progress: told rows done and their number.

    Raises:
        InvalidOptionError: when levers differ, or size is odd.
        MissingDependencyError: without pyarrow, or without PyAV for pictures.
        OutputError: when the folder cannot be written to.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise MissingDependencyError("LeRobot's layout needs 'pip install haustra[formats]'.") from error
    first = recordings[0]
    if size % 2:
        raise InvalidOptionError(f"size is {size}: give an even number, as H.264 wants it.")
    for one in recordings:
        if one.levers != first.levers:
            raise InvalidOptionError(f"'{one.folder}' has other levers than '{first.folder}'.")
    columns: dict[str, list[Any]] = {
        name: []
        for name in (
            "action",
            "observation.state",
            "timestamp",
            "frame_index",
            "episode_index",
            "index",
            "task_index",
            "next.reward",
            "next.done",
        )
    }
    episodes: list[dict[str, Any]] = []
    every = [np.arange(0, len(one.rows["step"]), max(1, round(1 / FRAME_RATE / one.interval))) for one in recordings]
    fps, total = round(FRAME_RATE), sum(map(len, every))
    with replaced_together(folder) as place:
        film = Mp4(_made(place / _VIDEO.format(video_key=_CAMERA, **_FIRST)), fps) if pictures else None
        done = 0
        for number, (one, steps) in enumerate(zip(recordings, every, strict=True)):
            eye = Eye(Camera(surroundings(one.folder / COLON, one.about["vehicle"]), size)) if film else None
            for index, step in enumerate(steps):
                follows = int(steps[min(index + 1, len(steps) - 1)])
                entries = {
                    "action": one.rows["levers"][follows].astype(np.float32),
                    "observation.state": observed(_row(one, int(step))).astype(np.float32),
                    "timestamp": np.float32(index / fps),
                    "frame_index": index,
                    "episode_index": number,
                    "index": done,
                    "task_index": 0,
                    "next.reward": np.float32(one.rows["tip_arc"][follows] - one.rows["tip_arc"][step]),
                    "next.done": index == len(steps) - 1,
                }
                for name, value in entries.items():
                    columns[name].append(value)
                if film and eye:
                    film.add(eye.draw(glance_at(*moment(one, float(one.rows["time"][step])))))
                done += 1
                progress(done, total)
            episodes.append({"length": len(steps), "from": done - len(steps), "to": done})
        if film:
            film.__exit__()
        features = _features(first, size if pictures else None, fps)
        _write_rows(pa, pq, _made(place / _DATA.format(**_FIRST)), columns)
        _write_episodes(pa, pq, place, episodes, columns, fps, pictures)
        task = pa.table({"task_index": pa.array([0], pa.int64()), "__index_level_0__": [_TASK]})
        about = {
            "index_columns": ["__index_level_0__"],
            "column_indexes": [],
            "columns": _PANDAS,
            "pandas_version": "2.2.0",
        }
        pq.write_table(task.replace_schema_metadata({"pandas": json.dumps(about)}), place / "meta/tasks.parquet")
        write_json(place / "meta/stats.json", {name: _stats(columns[name]) for name in columns})
        info = {
            "codebase_version": VERSION,
            "robot_type": f"haustra {first.about['vehicle']['kind']}",
            "total_episodes": len(episodes),
            "total_frames": done,
            "total_tasks": 1,
            "chunks_size": _CHUNK,
            "data_files_size_in_mb": _DATA_MB,
            "video_files_size_in_mb": _VIDEO_MB,
            "fps": fps,
            "splits": {"train": f"0:{len(episodes)}"},
            "data_path": _DATA,
            "video_path": _VIDEO if pictures else None,
            "features": features,
        }
        write_json(place / "meta/info.json", info)
    return {"dataset": str(folder), "episodes": len(episodes), "frames": done, "fps": fps, "version": VERSION}


_PANDAS = [
    {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64", "metadata": None},
    {
        "name": None,
        "field_name": "__index_level_0__",
        "pandas_type": "unicode",
        "numpy_type": "object",
        "metadata": None,
    },
]


def _made(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _write_rows(pa: Any, pq: Any, path: Path, columns: dict[str, list[Any]]) -> None:
    arrays = {}
    for name, values in columns.items():
        if np.ndim(values[0]):
            arrays[name] = pa.FixedSizeListArray.from_arrays(pa.array(np.concatenate(values)), len(values[0]))
        else:
            arrays[name] = pa.array(values)
    pq.write_table(pa.table(arrays), path)


def _write_episodes(
    pa: Any, pq: Any, place: Path, episodes: list[dict[str, Any]], columns: dict[str, Any], fps: int, pictures: bool
) -> None:
    rows = []
    for number, one in enumerate(episodes):
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [_TASK],
            "length": one["length"],
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": one["from"],
            "dataset_to_index": one["to"],
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        if pictures:
            row |= {f"videos/{_CAMERA}/{name}": 0 for name in ("chunk_index", "file_index")}
            row |= {
                f"videos/{_CAMERA}/from_timestamp": one["from"] / fps,
                f"videos/{_CAMERA}/to_timestamp": one["to"] / fps,
            }
        for name, values in columns.items():
            for statistic, value in _stats(values[one["from"] : one["to"]]).items():
                row[f"stats/{name}/{statistic}"] = value
        rows.append(row)
    pq.write_table(pa.Table.from_pylist(rows), _made(place / "meta/episodes/chunk-000/file-000.parquet"))


def _stats(values: Sequence[Any]) -> dict[str, list[Any]]:
    array = np.array(values, float).reshape(len(values), -1)
    found: dict[str, list[Any]] = {
        name: getattr(array, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")
    }
    return found | {"count": [len(array)]}


def _features(recording: Recording, size: int | None, fps: int) -> dict[str, Any]:
    names = observed_names(_row(recording, 0))
    single = {"shape": [1], "names": None}
    found: dict[str, Any] = {
        "action": {"dtype": "float32", "shape": [len(recording.levers)], "names": list(recording.levers)},
        "observation.state": {"dtype": "float32", "shape": [len(names)], "names": names},
        "timestamp": {"dtype": "float32", **single},
        "next.reward": {"dtype": "float32", **single},
        "next.done": {"dtype": "bool", **single},
    }
    found |= {name: {"dtype": "int64", **single} for name in ("frame_index", "episode_index", "index", "task_index")}
    if size is not None:
        about = {"video.height": size, "video.width": size, "video.channels": 3, "video.codec": "h264"}
        about |= {"video.pix_fmt": "yuv420p", "video.fps": fps, "video.is_depth_map": False, "has_audio": False}
        shape = {"shape": [size, size, 3], "names": ["height", "width", "channels"]}
        found[_CAMERA] = {"dtype": "video", **shape, "info": about}
    return found
