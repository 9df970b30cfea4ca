"""An episode as a moving picture: the tip camera beside the colon from outside, and what hand and wall feel."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.envs.learning.recording import Recording
from haustra.envs.learning.stage import stage_of
from haustra.envs.sim.native_batch import batch_model
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import Limits
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.renderer import CameraPose
from haustra.files import write_atomically

if TYPE_CHECKING:
    from PIL.Image import Image

WIDTH, HEIGHT = 480, 300
"""Size of the video's picture [pixels]."""
_SIDE = 192
"""Side of the square picture that the tip sees [pixels]."""
_PICTURES = 150
"""Pictures of a video at most; states between them are not drawn, but their peaks are told."""
_FRAME_MS, _LAST_MS = 100, 2000
"""How long a picture is shown, and the last one [ms]; engineering choice: 30 s are shown in half their time."""
_QUALITY = 60
"""Quality of the WebP compression, 0 to 100: some 8 kB a frame."""
_BEFORE_ANUS = 0.03
"""Length of shaft that is drawn outside the patient [m]."""
_INK, _PAPER, _RAIL, _FILL, _ALARM = "#30343b", "#ffffff", "#dfe3e8", "#2f6f8f", "#c2413b"


def write_video(
    path: Path,
    recording: Recording,
    bank: ColonSet,
    *,
    title: str,
    ending: str,
    limits: Limits,
    progress: Callable[[int, int], None] = lambda done, frames: None,
) -> Path:
    """Draw an episode as animated WebP, in fifteen seconds or in half its time, whichever is shorter.

    No OpenGL is needed: the renderers are those of `haustra.envs.view.picture`. The wall is drawn as the episode's
    physics and camera know it: as its table of distances from the centreline.

    Args:
        path: file to write.
        recording: the episode.
        bank: the colons that it was driven in.
        title: of the picture.
        ending: how the episode ended.
        limits: of the task, marked beside the wall force.
        progress: told pictures drawn and their number.

    Raises:
        OutputError: when the file cannot be written.
    """
    shown = np.unique(np.linspace(0, len(recording.time) - 1, min(_PICTURES, len(recording.time))).round().astype(int))
    bank = bank.with_mesentery(recording.displacement is not None)  # the scene that was driven

    def write(temporary: Path) -> None:
        frames = _frames(recording, shown, bank, title, ending, limits, progress)
        first = next(frames)
        lasts = [_FRAME_MS] * (len(shown) - 1) + [_LAST_MS]
        first.save(
            temporary, format="WEBP", save_all=True, append_images=frames, duration=lasts, loop=0, quality=_QUALITY
        )

    return write_atomically(path, write)


def _frames(
    recording: Recording,
    shown: Int[np.ndarray, " pictures"],
    bank: ColonSet,
    title: str,
    ending: str,
    limits: Limits,
    progress: Callable[[int, int], None],
) -> "Iterator[Image]":
    from PIL import Image

    size = (WIDTH - _SIDE, HEIGHT)
    scope, lens, case = _Scope(bank), lens_of(bank.design.tip, _SIDE, _SIDE), bank.cases[recording.case]
    stage = stage_of(case, recording.displacement, lens, size)
    eyes = Endoscope(case.colon(), lens, surface=stage.surface)
    peaks = np.maximum.accumulate(recording.wall_force)
    faster = float(np.ptp(recording.time[shown])) / max(1, len(shown) - 1) / (_FRAME_MS / 1000)
    for done, index in enumerate(shown.tolist()):
        shape, tip, frame = scope.at(recording.qpos[index])
        picture = Image.new("RGB", (WIDTH, HEIGHT), _PAPER)
        eye, outside = stage.at(index, tip, float(recording.tip_arc[index]))
        seen = eyes.picture(CameraPose.of_tip(eye, frame))
        picture.paste(Image.fromarray(seen), (0, 0))
        drawn = outside.draw(shape, bank.design.diameter / 2, bending_length=bank.design.bending.length)
        picture.paste(Image.fromarray(drawn), (_SIDE, 0))
        said = title, ending if index == shown[-1] else "", f"{faster:.2g}x"
        _read_out(picture, recording, index, said, limits, float(peaks[index]))
        progress(done + 1, len(shown))
        yield picture


class _Scope:
    """From joint positions to a shape."""

    def __init__(self, bank: ColonSet) -> None:
        self._model = batch_model(bank.scene)
        self._data = mujoco.MjData(self._model)
        self._links = [self._model.body(name).id for name in bank.scene.cable.links]
        self._tip = self._model.site("scope/tip").id
        self._behind = bank.scene.cable.node_distances
        self._start = bank.scene.options.start_depth

    def at(
        self, qpos: Float[np.ndarray, " joints"]
    ) -> tuple[Float[np.ndarray, "nodes 3"], Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
        """Axis from shortly before the anus to the tip [m], the tip, and its frame."""
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        tip = self._data.site_xpos[self._tip].copy()
        shape = np.vstack([self._data.xpos[self._links], tip])
        # By length, not by place: a loop of a colon may hang below the anus. The last link is drawn in any case.
        inside = self._behind < self._start + float(qpos[0]) + _BEFORE_ANUS
        first = min(int(inside.argmax()), len(shape) - 1)
        start = [[0.0, 0.0, min(-_BEFORE_ANUS, shape[first, 2] - 0.01)]]
        nodes = np.vstack([start, shape[first:]])
        return nodes, tip, self._data.site_xmat[self._tip].reshape(3, 3).copy()


def _read_out(
    picture: "Image", recording: Recording, index: int, said: tuple[str, str, str], limits: Limits, peak: float
) -> None:
    """Numbers and bars under the tip's picture; `said` are title, ending, and how much faster it is shown."""
    from PIL import ImageDraw, ImageFont

    title, ending, faster = said

    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(11)
    force, way = float(recording.wall_force[index]), float(recording.progress[index])
    row, left = _SIDE + 4, 6
    while draw.textlength(title, font=font) > _SIDE - left:
        title = title.removesuffix("…")[:-1] + "…"
    draw.text((left, row), title, fill=_INK, font=font)
    when = f"{recording.time[index]:.1f} s (shown {faster})   tip {recording.tip_arc[index]:.2f} m in"
    draw.text((left, row + 16), when, fill=_INK, font=font)
    draw.text((left, row + 32), "way", fill=_INK, font=font)
    _bar(draw, row + 35, way, _FILL)
    draw.text((150, row + 32), f"{way:.0%}", fill=_INK, font=font)
    full = 1.1 * limits.perforation_force
    draw.text((left, row + 48), "wall", fill=_INK, font=font)
    _bar(draw, row + 51, force / full, _ALARM if force > limits.safe_force else _FILL)
    for limit in (limits.safe_force, limits.perforation_force):
        at = _BAR[0] + limit / full * (_BAR[1] - _BAR[0])
        draw.line([(at, row + 49), (at, row + 61)], fill=_INK)
    draw.text((150, row + 48), f"{force:.1f} N", fill=_INK, font=font)
    most = f"peak {peak:.1f} N   hand {recording.push_force[index]:.1f} N"
    draw.text((left, row + 64), most, fill=_INK, font=font)
    draw.text((left, row + 80), ending, fill=_ALARM, font=font)


_BAR = (36, 144)
"""Columns where a bar begins and ends."""


def _bar(draw, row: int, share: float, colour: str) -> None:
    left, right = _BAR
    draw.rectangle([(left, row), (right, row + 8)], fill=_RAIL)
    draw.rectangle([(left, row), (left + round(min(max(share, 0.0), 1.0) * (right - left)), row + 8)], fill=colour)
