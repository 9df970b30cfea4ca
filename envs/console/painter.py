"""Pictures from the tip's camera, drawn in a process of their own, so that physics never waits for one."""

import io
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from haustra.envs.console.channel import INTACT, treated, wounds
from haustra.envs.console.vehicle import Surroundings
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.inside import lens_inside
from haustra.envs.view.picture.light import Response
from haustra.envs.view.picture.renderer import CameraPose, SurfaceView
from haustra.envs.view.picture.surface import ColonSurface, MovingSurface
from haustra.errors import InvalidMeshError

_INERTIA = 0.8
"""Share of the last picture's exposure that stays: it does not flicker [1]; engineering choice."""
_SEEN = 0.5
"""Share of a picture that shows wall at least where the camera is not outside of it [1]; engineering choice."""
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
    tissue: Int[np.ndarray, " lesions"] | None = None
    """What was taken of lesions (`haustra.envs.console.channel.Channel.tissue`); nothing when None."""
    blood: Float[np.ndarray, "places 4"] | None = None
    """Places of the wall at rest that bleed, and how far blood lies around each [m]; nothing when None."""


@dataclass(frozen=True)
class Camera:
    """What pictures are drawn of, and how."""

    around: Surroundings
    size: int
    """Rows and columns of a picture [pixels]."""


class Eye:
    """Draws glances one by one."""

    def __init__(self, camera: Camera) -> None:
        """Take the colon's surface."""
        self._around, self._size = camera.around, camera.size
        around = camera.around
        self._carried = around.tables and CurrentColon(around.colon, around.tables, around.origin, around.axes)
        self._none = np.zeros((0, 4))
        self._see([INTACT] * len(camera.around.colon.lesions))

    def _see(self, tissue: Sequence[int]) -> None:
        """Take the surface without what was taken, and blood where it was."""
        around, given = self._around, self._around.colon
        self._tissue, self._blood = list(tissue), self._none
        try:
            colon = treated(given, tissue)
        except InvalidMeshError:  # another wall is too near: it is drawn uncut, and bleeds
            colon = given
        if around.tables is None:
            self._surface = ColonSurface(colon)
        else:
            self._surface = MovingSurface(colon, around.tables, around.origin, around.axes)
        lens = around.lens.at(self._size, self._size)
        self._scope = Endoscope(colon, lens, surface=self._surface, response=Response(inertia=_INERTIA))
        for place, reach in wounds(given, tissue):
            self._scope.appearance.bleed(place, reach)

    def _bleed(self, blood: Float[np.ndarray, "places 4"]) -> None:
        """Let it bleed where it does; a wall that no longer does is taken anew."""
        if len(blood) < len(self._blood) or not np.array_equal(blood[: len(self._blood)], self._blood):
            self._see(self._tissue)
        for *place, reach in blood[len(self._blood) :]:
            self._scope.appearance.bleed(np.array(place), float(reach))
        self._blood = blood

    def draw(self, glance: Glance) -> UInt8[np.ndarray, "size size 3"]:
        """What the camera sees; the wall makes room for the tip."""
        if glance.tissue is not None and glance.tissue.tolist() != self._tissue:
            self._see(glance.tissue.tolist())
        self._bleed(self._none if glance.blood is None else glance.blood)
        surface = self._surface
        if glance.widths is not None:
            surface.widen(glance.widths)
        if glance.displacement is not None and isinstance(surface, MovingSurface):
            surface.move(glance.displacement)
        view = self._look(glance, glance.tip)
        if np.isfinite(view.distance[view.lens.within]).mean() < _SEEN:
            view = self._look(glance, self._inside(glance))
        return self._scope.develop(self._scope.radiance(view))

    def _look(self, glance: Glance, tip: Float[np.ndarray, "3"]) -> SurfaceView:
        """What a camera there sees; the wall makes room for it."""
        self._surface.make_room(tip, glance.frame[:, 2], glance.arc, self._around.radius)
        return self._scope.look(CameraPose.of_tip(tip, glance.frame))

    def _inside(self, glance: Glance) -> Float[np.ndarray, "3"]:
        """Where the tip would be, had the wall not given way so far that it cannot make room."""
        line, radius = self._around.colon.centreline, self._around.colon.radius

        def inside(rest: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
            return lens_inside(line.points, line.frames, line.arc, radius, rest, glance.arc)

        if self._carried is None or glance.displacement is None:
            return inside(glance.tip)
        return self._carried.moved_at_rest(glance.displacement, glance.tip, glance.arc, inside)


class Painter:
    """A process that draws the newest glance whenever it has drawn the one before."""

    def __init__(self, camera: Camera) -> None:
        """Start the process; it is ready some seconds later (`ready`)."""
        context = get_context("spawn")
        self._own, theirs = context.Pipe()
        self._process = context.Process(target=_paint, args=(camera, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self.busy, self.ready = True, False
        self._about: Any = None

    def ask(self, glance: Glance, about: Any) -> None:
        """Ask for a picture, when it is not `busy` with one; `about` comes back with it."""
        self.busy, self._about = True, about
        self._own.send(glance)

    def take(self) -> tuple[bytes, Any] | None:
        """A JPEG picture that is done, and what it is about; None when there is none.

        Raises:
            EOFError: when the process has ended.
        """
        if not self._own.poll():
            return None
        content = self._own.recv_bytes()
        self.busy = False
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
    line = camera.around.colon.centreline
    middle = len(line.arc) // 2
    eye.draw(Glance(line.points[middle], line.frames[middle], float(line.arc[middle])))  # compiles
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
