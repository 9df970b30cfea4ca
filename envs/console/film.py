"""Recordings as films: the endoscope's picture beside the colon from outside, in H.264 or as a GIF."""

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.console.painter import Camera, Eye
from haustra.envs.console.recording import COLON, Recording
from haustra.envs.console.source import glance_at, moment
from haustra.envs.console.stage import Stage
from haustra.envs.console.vehicle import Surroundings
from haustra.envs.console.vehicles import surroundings
from haustra.envs.runs.measure.progress import segment_at
from haustra.envs.view.picture.outside import OutsideView, default_rotation
from haustra.envs.view.picture.tube import Tube, tube
from haustra.errors import InvalidOptionError, MissingDependencyError
from haustra.files import write_atomically
from haustra.models.anatomy.colon import Surface

if TYPE_CHECKING:
    from PIL.Image import Image

SIDE = 320
"""Rows and columns of each of the two pictures [pixels]."""
_BEFORE_ANUS = 0.03
"""Length of the device that is drawn outside the patient [m]."""
_LINE = 24
"""Rows of what is written below [pixels]; even, as H.264 wants it."""


def write_film(
    path: Path,
    recording: Recording,
    *,
    fps: float = 10.0,
    speed: float = 1.0,
    progress: Callable[[int, int], None] = lambda done, frames: None,
) -> dict[str, Any]:
    """Write a recording as a film.

    Args:
        path: file to write, .mp4 or .gif.
        recording: what is shown.
        fps: pictures a second.
        speed: simulated time over the film's.
        progress: told pictures done and their number.

    Raises:
        InvalidOptionError: for another kind of file.
        MissingDependencyError: without PyAV, for .mp4.
        OutputError: when the file cannot be written.
    """
    if path.suffix not in (".mp4", ".gif"):
        raise InvalidOptionError(f"Cannot write a film as '{path.name}': use .mp4 or .gif.")
    times = np.arange(0.0, float(recording.rows["time"][-1]) + 1e-9, speed / fps)
    around = surroundings(recording.folder / COLON, recording.about["vehicle"])
    pictures = draw_pictures(around, times, lambda at: moment(recording, at), progress)
    write = _write_mp4 if path.suffix == ".mp4" else _write_gif
    write_atomically(path, lambda file: write(file, pictures, fps))
    return {"film": str(path), "pictures": len(times), "seconds": len(times) / fps}


def draw_pictures(
    around: Surroundings,
    times: Float[np.ndarray, " pictures"],
    moment: Callable[[float], tuple[Mapping[str, Any], Mapping[str, Any]]],
    progress: Callable[[int, int], None] = lambda done, pictures: None,
) -> Iterator["Image"]:
    """Draw what a device's camera sees beside the colon from outside, one picture after the other.

    Args:
        around: the colon, and the device's lens.
        times: simulated time of each picture [s].
        moment: gives the row and the frame of a time, as `haustra.envs.console.vehicle.Look` has them; a frame may have
            the device's `body`, a `Tube`, instead of its shape.
        progress: told pictures done and their number.
    """
    from PIL import Image, ImageDraw, ImageFont

    eye, stage = Eye(Camera(around, SIDE)), Stage(around)
    colon, font = around.colon, ImageFont.load_default(13)
    rotation = default_rotation(colon.lumen, colon.centreline.points)
    some = [moment(float(at))[1] for at in times[:: max(1, len(times) // 4)]]
    framed = np.vstack([stage.vertices(frame.get("displacement")) for frame in some])
    for number, at in enumerate(times):
        row, frame = moment(float(at))
        picture = Image.new("RGB", (2 * SIDE, SIDE + _LINE), "#ffffff")
        picture.paste(Image.fromarray(eye.draw(glance_at(row, frame))), (0, 0))
        rings = Surface(stage.vertices(frame.get("displacement"), frame.get("widths")), stage.faces)
        view = OutsideView(rings, rotation, width=SIDE, height=SIDE, framed=framed)
        picture.paste(Image.fromarray(view.draw_body(_body(row, frame, around))), (SIDE, 0))
        where = segment_at(colon, float(row["tip_arc"])).replace("_", " ")
        time, arc, force = (float(row[name]) for name in ("time", "tip_arc", "wall_force"))
        said = f"{time:.1f} s   {where}, {arc * 100:.0f} cm   wall {force:.1f} N"
        ImageDraw.Draw(picture).text((6, SIDE + 4), said, fill="#30343b", font=font)
        progress(number + 1, len(times))
        yield picture


def _body(row: Mapping[str, Any], frame: Mapping[str, Any], around: Surroundings) -> Tube:
    """The device as the frame gives it, or a tube along its axis."""
    if "body" in frame:
        return frame["body"]
    return tube(_inside(frame["shape"], row), around.radius, bending_length=0.1)


def _inside(shape: np.ndarray, row: Any) -> np.ndarray:
    """The axis from shortly before the anus on: the rest of a shaft is not in the picture."""
    if "insertion" not in row:
        return shape
    behind = np.concatenate([np.cumsum(np.linalg.norm(np.diff(shape, axis=0), axis=1)[::-1])[::-1], [0.0]])
    first = int(np.argmax(behind < float(row["insertion"]) + _BEFORE_ANUS))
    return shape[min(first, len(shape) - 2) :]


def _write_mp4(path: Path, pictures: Iterator["Image"], fps: float) -> None:
    with Mp4(path, fps) as film:
        for picture in pictures:
            film.add(np.asarray(picture))


class Mp4:
    """A film that is written picture by picture, in H.264."""

    def __init__(self, path: Path, fps: float) -> None:
        """Begin a file.

        Raises:
            MissingDependencyError: without PyAV.
        """
        try:
            import av
        except ImportError as error:
            raise MissingDependencyError("Films as .mp4 need 'pip install haustra[drive]'; .gif does not.") from error
        self._av, self._file = av, av.open(str(path), "w", format="mp4")
        self._rate, self._stream = Fraction(fps).limit_denominator(1000), None

    def __enter__(self) -> "Mp4":
        """Nothing more."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the file."""
        if self._stream is not None:
            for packet in self._stream.encode():
                self._file.mux(packet)
        self._file.close()

    def add(self, picture: UInt8[np.ndarray, "rows columns 3"]) -> None:
        """One more picture, of even rows and columns."""
        if self._stream is None:
            self._stream = self._file.add_stream("libx264", rate=self._rate, options={"crf": "23"})
            self._stream.height, self._stream.width = picture.shape[:2]
            self._stream.pix_fmt = "yuv420p"
        for packet in self._stream.encode(self._av.VideoFrame.from_ndarray(picture, format="rgb24")):
            self._file.mux(packet)


def _write_gif(path: Path, pictures: Iterator["Image"], fps: float) -> None:
    first = next(pictures)
    rest = (picture.quantize(128) for picture in pictures)
    first.quantize(128).save(path, format="GIF", save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)
