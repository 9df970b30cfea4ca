"""Pictures from the tip's camera, drawn in a process of their own, so that physics never waits for one."""

import io
import signal
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.console.vehicle import Surroundings
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.view.picture.inside import lens_inside
from haustra.envs.view.picture.lens import camera_axes
from haustra.envs.view.picture.tip import tip_view
from haustra.models.anatomy.colon import Surface
from haustra.models.wall.signed_distance import surface_arcs

_BEHIND, _BEFORE = 0.08, 0.35
"""Wall that is drawn: from this far behind the tip to this far before it, along the colon [m]."""
_QUALITY = 80
"""Quality of the JPEG compression, 0 to 100."""


@dataclass(frozen=True)
class Glance:
    """Where the camera is, in what colon."""

    tip: Float[np.ndarray, "3"]
    """Optical centre [m]."""
    frame: Float[np.ndarray, "3 3"]
    """Columns: wire 'up', wire 'left', viewing direction."""
    arc: float
    """Arc length of the tip [m]."""
    displacement: Float[np.ndarray, "nodes 7"] | None = None
    """Displacement of the colon's axis; at rest when None."""
    widths: Float[np.ndarray, " rows"] | None = None
    """Widths of the lumen at even arc lengths, over that at rest [1]; as at rest when None."""


@dataclass(frozen=True)
class Camera:
    """What pictures are drawn of, and how."""

    around: Surroundings
    size: int
    """Rows and columns of a picture [pixels]."""


class Eye:
    """Draws glances one by one."""

    def __init__(self, camera: Camera) -> None:
        """Find out which wall is where along the colon."""
        around, self._size = camera.around, camera.size
        colon = around.colon
        self._around = around
        self._arcs = surface_arcs(colon)
        self._face_arcs = self._arcs[colon.lumen.faces].mean(axis=1)
        tables = around.tables
        self._moved = None if tables is None else CurrentColon(colon, tables, around.origin, around.axes)

    def draw(self, glance: Glance) -> UInt8[np.ndarray, "size size 3"]:
        """What the camera sees."""
        lumen, view = self._wall(glance), self._around.field_of_view_deg
        return tip_view(lumen, self._lens(glance), camera_axes(glance.frame), view, size=self._size, samples=1)

    def _lens(self, glance: Glance) -> Float[np.ndarray, "3"]:
        """Where the picture is drawn from."""
        colon, arc = self._around.colon, glance.arc
        line = colon.centreline
        moved = self._moved if glance.displacement is not None else None
        tip, radius = glance.tip, colon.radius
        if glance.widths is not None:
            rows = np.linspace(0.0, line.length, len(glance.widths))
            radius = radius * np.interp(line.arc, rows, glance.widths)[:, None]
        if moved is None or glance.displacement is None:
            return lens_inside(line.points, line.frames, line.arc, radius, tip, arc)
        rest = moved.to_reference(glance.displacement, tip, arc)
        rest = lens_inside(line.points, line.frames, line.arc, radius, rest, arc)
        return moved.to_current(glance.displacement, rest, arc)

    def _wall(self, glance: Glance) -> Surface:
        """Wall around the tip, where it is now."""
        lumen, line = self._around.colon.lumen, self._around.colon.centreline
        near = (self._face_arcs > glance.arc - _BEHIND) & (self._face_arcs < glance.arc + _BEFORE)
        used, faces = np.unique(lumen.faces[near], return_inverse=True)
        points, arcs = lumen.vertices[used], self._arcs[used]
        if glance.widths is not None:
            middle = np.stack([np.interp(arcs, line.arc, line.points[:, axis]) for axis in range(3)], axis=1)
            share = np.interp(arcs, np.linspace(0.0, line.length, len(glance.widths)), glance.widths)
            points = middle + (points - middle) * share[:, None]
        if glance.displacement is not None and self._moved is not None:
            points = self._moved.to_current_all(glance.displacement, points, arcs)
        return Surface(points, faces.reshape(-1, 3))


class Painter:
    """A process that draws the newest glance whenever it has drawn the one before."""

    def __init__(self, camera: Camera) -> None:
        """Start the process; it is ready some seconds later (`ready`)."""
        context = get_context("spawn")
        self._own, theirs = context.Pipe()
        self._process = context.Process(target=_paint, args=(camera, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self._busy, self.ready = True, False
        self._about: Any = None

    def ask(self, glance: Glance, about: Any) -> bool:
        """Ask for a picture, unless one is being drawn; `about` comes back with it."""
        if self._busy:
            return False
        self._busy, self._about = True, about
        self._own.send(glance)
        return True

    def take(self) -> tuple[bytes, Any] | None:
        """A JPEG picture that is done, and what it is about; None when there is none.

        Raises:
            EOFError: when the process has ended.
        """
        if not self._own.poll():
            return None
        content = self._own.recv_bytes()
        self._busy = False
        if not self.ready:
            self.ready = True
            return None
        return content, self._about

    def close(self) -> None:
        """End the process."""
        self._own.close()
        self._process.terminate()
        self._process.join(timeout=5)


def _paint(camera: Camera, pipe: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, and closes the pipe
    eye = Eye(camera)
    pipe.send_bytes(b"ready")
    while True:
        try:
            glance = pipe.recv()
            pipe.send_bytes(jpeg(eye.draw(glance)))
        except (EOFError, OSError):
            return


def jpeg(picture: UInt8[np.ndarray, "rows columns 3"]) -> bytes:
    """A picture, compressed."""
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, format="JPEG", quality=_QUALITY)
    return content.getvalue()
