"""The endoscope's picture by OpenGL: the same wall, lens, light and looks as by exact rays, on a graphics processor.

    scope = GlEndoscope(colon, lens, surface=surface)
    scope.picture(pose)                            # red, green, blue
    scope.distance()                               # along the rays of that picture [m]

Vertices are taken along with the colon and kept off the device by compute shaders, so that a frame sends some numbers
for each node of the axis and brings back the picture. The rasteriser draws triangles where the lens shows their
corners, with straight edges; each pixel's ray is then followed to its triangle's plane exactly. Shading and exposure
are compute shaders too: graphics processors for computing draw with a small part of themselves only.
"""

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.view.picture import gl_shaders, mucosa
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.gl_device import GlDevice
from haustra.envs.view.picture.gl_shaders import SPARSE
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.light import Light, Response
from haustra.envs.view.picture.renderer import MOST, CameraPose, radii, triangles_around
from haustra.envs.view.picture.shader import SHARED, common_numbers, lens_planes, pixel_angle
from haustra.envs.view.picture.surface import STRETCH, ColonSurface
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.indentation import FALL

REACH = 0.4
"""Farther along the colon than this from the camera nothing is drawn [m]; engineering choice
(`haustra.envs.view.picture.in_sight`)."""
_BEYOND = 0.02
"""Stretches count as so much wider than they are [m]; engineering choice: what a device may push them out by."""

_USES = {
    "nodes": "STREAM_DRAW",
    **dict.fromkeys(("local", "normals", "light", "gain", "bright"), "DYNAMIC_COPY"),
    "picture": "STREAM_READ",
}
"""What buffers that change are for, by OpenGL's names: sent for each picture, worked on by shaders, fetched."""


class GlEndoscope:
    """Camera and light at a tip in one colon, drawn by OpenGL."""

    def __init__(
        self,
        colon: Colon,
        lens: Lens,
        *,
        surface: ColonSurface | None = None,
        appearance: Appearance | None = None,
        light: Light | None = None,
        response: Response | None = None,
        seed: int = 0,
    ) -> None:
        """Look into a colon; arguments are those of `haustra.envs.view.picture.endoscope.Endoscope`.

        Raises:
            InvalidOptionError: when noise or motion blur is asked for, which the rays draw.
            MissingDependencyError: when no OpenGL with compute shaders draws here.
        """
        self._response, self._light, self.lens = response or Response(), light or Light(), lens
        if self._response.noise or self._response.exposure:
            raise InvalidOptionError("OpenGL's pictures have no noise and no motion blur: draw them by rays.")
        self.surface = surface or ColonSurface(colon)
        self.appearance = appearance or Appearance(colon, self.surface, seed=seed)
        self.device = device = GlDevice(lens.width, lens.height)
        own, count = self.surface, len(self.surface.vertices)
        guides = len(self._light.guides)
        stages = {
            "carry": {"compute": gl_shaders.write_carry()},
            "normals": {"compute": gl_shaders.write_normals()},
            "seen": dict(zip(("vertex", "fragment"), gl_shaders.write_seen(), strict=True)),
            "shade": {"compute": gl_shaders.write_shade(self.appearance.kinds, guides)},
            "gain": {"compute": gl_shaders.write_gain()},
            "develop": {"compute": gl_shaders.write_develop()},
        }
        self._programs = {name: device.program(text) for name, text in stages.items()}
        starts, around = triangles_around(own)
        pixels = lens.width * lens.height
        planes = np.where(lens.within[None], lens_planes(lens), np.array([0, 0, 0, -1.0])[:, None, None])
        curve = self._response.curve()
        held = {
            "axis": np.zeros((count, 4), np.float32),
            "lever": np.zeros((count, 4), np.float32),
            "arcs": own.arcs.astype(np.float32),
            "nodes": np.zeros((len(own.posture().nodes), 12), np.float32),
            "local": np.zeros((count, 4), np.float32),
            "faces": own.faces,
            "starts": starts,
            "around": around,
            "normals": np.zeros((count, 4), np.float32),
            "wall": self.appearance.wall,
            "lens": np.moveaxis(planes, 0, -1).astype(np.float32),
            "light": np.zeros((pixels, 4), np.float32),
            "gain": np.zeros(2, np.float32),
            "bright": np.zeros(-(-lens.width // SPARSE) * -(-lens.height // SPARSE), np.uint32),
            "curve": curve.astype(np.uint32),
            "picture": np.zeros(pixels, np.uint32),
            "radii": radii(lens).astype(np.float32),
        }
        self._held = {name: device.buffer(values, _USES.get(name, "STATIC_DRAW")) for name, values in held.items()}
        self._top, self._places = len(curve) - 1, len(held["radii"])
        numbers = np.zeros(4 * (SHARED + 3 * guides + 7 * len(self.appearance.kinds)), np.float32)
        self._held["common"] = device.buffer(numbers, "STREAM_DRAW")
        self._device_room = 0
        self._picture = np.zeros((lens.height, lens.width, 4), np.uint8)
        self._numbers = np.array([*lens.centre, lens.width, lens.height, *np.ravel(lens.stretch)], np.float32)
        self._widest = np.radians(min(lens.field_of_view_deg, 250.0)) / 2
        self._placings = -1
        self._textures()
        self._standing()

    def picture(self, pose: CameraPose) -> UInt8[np.ndarray, "height width 3"]:
        """The picture in colour."""
        self.draw(pose)
        return self.fetch()

    def fetch(self) -> UInt8[np.ndarray, "height width 3"]:
        """The picture that was drawn last, when it is done; other work may be done in between."""
        self.device.make_current()
        self.device.read(self._held["picture"], self._picture)
        return np.ascontiguousarray(self._picture[..., :3])

    def distance(self) -> Float[np.ndarray, "height width"]:
        """Along the rays of the last picture [m]; infinite where they meet nothing."""
        light = np.empty((self.lens.height, self.lens.width, 4), np.float32)
        self.device.read(self._held["light"], light)
        return np.where(light[..., 3] > 0, light[..., 3], np.inf)

    def radiance(self) -> Float[np.ndarray, "height width 3"]:
        """Light of the last picture, before exposure (`haustra.envs.view.picture.endoscope.Endoscope.radiance`)."""
        light = np.empty((self.lens.height, self.lens.width, 4), np.float32)
        self.device.read(self._held["light"], light)
        return light[..., :3]

    def bleed(self, place: Float[np.ndarray, "3"], reach: float) -> None:
        """Let blood lie on the wall (`haustra.envs.view.picture.appearance.Appearance.bleed`)."""
        self.appearance.bleed(place, reach)
        self.device.write(self._held["wall"], self.appearance.wall)

    def draw(self, pose: CameraPose) -> None:
        """Draw, and leave the picture on the device: does not wait for it, and the surface may move on."""
        device, surface, held = self.device, self.surface, self._held
        gl = device.gl
        device.make_current()
        if self._placings != surface.placings:
            self._send_skin()
        vertices, triangles = self._in_sight(pose)
        posture = surface.posture()
        device.write(held["nodes"], posture.nodes.astype(np.float32))
        count = self._send_device(vertices)
        program = self._use("carry")
        gl.glUniform1i(device.place(program, "places"), count)
        gl.glUniform3f(device.place(program, "eye"), *pose.position.tolist())
        gl.glUniform3fv(device.place(program, "sides"), 3, pose.rotation.T.astype(np.float32).ravel())
        gl.glUniform4fv(device.place(program, "world"), 3, posture.axes.astype(np.float32).ravel())
        self._bind("axis", "lever", "arcs", "nodes", "device", "local")
        device.over(program, vertices)
        program = self._use("normals")
        self._bind("local", "faces", "starts", "around", "normals")
        device.over(program, vertices)
        self._rasterise(triangles)
        common = common_numbers(self.appearance, pose, self._light, self._pixel)
        device.write(held["common"], common)
        program = self._use("shade")
        gl.glBindBufferBase(gl.GL_UNIFORM_BUFFER, 0, held["common"])
        self._bind("local", "faces", "starts", "around", "normals", "wall", "lens", "light")
        pixels = [(0, self.lens.width * self.lens.height)]
        device.over(program, pixels)
        self._use("gain")
        self._bind("light", "gain", "bright")
        gl.glDispatchCompute(1, 1, 1)
        gl.glMemoryBarrier(gl.GL_ALL_BARRIER_BITS)
        program = self._use("develop")
        self._bind("light", "gain", "curve", "picture")
        device.over(program, pixels)

    def _use(self, name: str) -> int:
        self.device.gl.glUseProgram(self._programs[name])
        return self._programs[name]

    def _bind(self, *names: str) -> None:
        self.device.bind([self._held[name] for name in names])

    def _in_sight(self, pose: CameraPose) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        """Ranges of vertices and of triangles that the camera may see, from a first one to before a last one."""
        surface = self.surface
        middles, reaches = surface.balls()
        middles, reaches = (middles - pose.position) @ pose.rotation, reaches + _BEYOND
        away = np.linalg.norm(middles, axis=1)
        wide = np.where(away > reaches, np.arcsin(np.minimum(reaches / np.maximum(away, 1e-9), 1.0)), np.pi)
        angle = np.arccos(np.clip(-middles[:, 2] / np.maximum(away, 1e-9), -1, 1))
        beside = int(np.argmin(away - reaches))
        near = np.abs(np.arange(surface.count) - beside) <= REACH / STRETCH
        shown = np.flatnonzero((angle <= wide + self._widest) & near)
        needed = surface.needed(shown)
        return _runs(needed, surface.ends), _runs(shown, surface.face_ends)

    def _send_skin(self) -> None:
        skin = self.surface.skin()
        for name, three, one in (("axis", skin.axis, skin.node), ("lever", skin.lever, skin.share)):
            self.device.write(self._held[name], np.column_stack([three, one]).astype(np.float32))
        self._placings = self.surface.placings

    def _send_device(self, vertices: list[tuple[int, int]]) -> int:
        """Places of the device that may push what is drawn; how many there are."""
        own, arcs = self.surface.device, self.surface.arcs
        if own is None or not vertices:
            return 0
        low = min(arcs[first:last].min() for first, last in vertices)
        high = max(arcs[first:last].max() for first, last in vertices)
        near = (own.arcs > low - own.tops / FALL) & (own.arcs < high + own.tops / FALL)
        rows = np.zeros((int(near.sum()), 8), np.float32)
        rows[:, :3], rows[:, 3], rows[:, 4], rows[:, 5] = own.places[near], own.arcs[near], own.tops[near], own.radius
        if len(rows) > self._device_room:
            self._device_room = 2 * len(rows)
            self._held["device"] = self.device.buffer(np.zeros((self._device_room, 8), np.float32), "STREAM_DRAW")
        if len(rows):
            self.device.write(self._held["device"], rows)
        return len(rows)

    def _rasterise(self, triangles: list[tuple[int, int]]) -> None:
        gl, device = self.device.gl, self.device
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._frame)
        gl.glViewport(0, 0, self.lens.width, self.lens.height)
        gl.glClearBufferuiv(gl.GL_COLOR, 0, np.zeros(4, np.uint32))
        gl.glClearBufferfv(gl.GL_DEPTH, 0, np.ones(1, np.float32))
        program = self._use("seen")
        self._bind("radii")
        gl.glBindVertexArray(self._array)
        base = device.place(program, "base")
        for first, last in triangles:
            gl.glUniform1i(base, first)
            gl.glDrawElements(gl.GL_TRIANGLES, 3 * (last - first), gl.GL_UNSIGNED_INT, gl.GLvoidp(12 * first))
        gl.glMemoryBarrier(gl.GL_ALL_BARRIER_BITS)

    def _textures(self) -> None:
        """Where triangles are drawn, and the random numbers of all patterns."""
        gl, width, height = self.device.gl, self.lens.width, self.lens.height
        seen, depth, lattice = (int(each) for each in gl.glGenTextures(3))
        rows = mucosa.corners(self.appearance.lattice).astype(np.float32)
        about = (
            (seen, gl.GL_R32UI, width, height, gl.GL_RED_INTEGER, gl.GL_UNSIGNED_INT, None),
            (depth, gl.GL_DEPTH_COMPONENT32F, width, height, gl.GL_DEPTH_COMPONENT, gl.GL_FLOAT, None),
            (lattice, gl.GL_RGBA32F, 256, len(rows) // 256, gl.GL_RGBA, gl.GL_FLOAT, rows),
        )
        for texture, kind, columns, lines, form, number, values in about:
            gl.glBindTexture(gl.GL_TEXTURE_2D, texture)
            gl.glTexImage2D(gl.GL_TEXTURE_2D, 0, kind, columns, lines, 0, form, number, values)
            for side in (gl.GL_TEXTURE_MIN_FILTER, gl.GL_TEXTURE_MAG_FILTER):
                gl.glTexParameteri(gl.GL_TEXTURE_2D, side, gl.GL_NEAREST)
        self._frame = int(gl.glGenFramebuffers(1))
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._frame)
        gl.glFramebufferTexture2D(gl.GL_FRAMEBUFFER, gl.GL_COLOR_ATTACHMENT0, gl.GL_TEXTURE_2D, seen, 0)
        gl.glFramebufferTexture2D(gl.GL_FRAMEBUFFER, gl.GL_DEPTH_ATTACHMENT, gl.GL_TEXTURE_2D, depth, 0)
        for unit, texture in enumerate((seen, lattice)):
            gl.glActiveTexture(gl.GL_TEXTURE0 + unit)
            gl.glBindTexture(gl.GL_TEXTURE_2D, texture)

    def _standing(self) -> None:
        """What stays as it is from picture to picture."""
        gl, held, device, lens = self.device.gl, self._held, self.device, self.lens
        self._pixel = pixel_angle(lens)
        held["device"] = device.buffer(np.zeros(8, np.float32))
        self._array = int(gl.glGenVertexArrays(1))
        gl.glBindVertexArray(self._array)
        gl.glBindBuffer(gl.GL_ARRAY_BUFFER, held["local"])
        gl.glEnableVertexAttribArray(0)
        gl.glVertexAttribPointer(0, 4, gl.GL_FLOAT, False, 16, gl.GLvoidp(0))
        gl.glBindBuffer(gl.GL_ELEMENT_ARRAY_BUFFER, held["faces"])
        gl.glEnable(gl.GL_DEPTH_TEST)
        gl.glEnable(gl.GL_CULL_FACE)
        gl.glEnable(gl.GL_CLIP_DISTANCE0)
        gl.glDisable(gl.GL_BLEND)
        gl.glDisable(gl.GL_DITHER)
        gl.glFrontFace(gl.GL_CCW)
        gl.glCullFace(gl.GL_BACK)
        program = self._use("seen")
        gl.glUniform2f(device.place(program, "centre"), *self._numbers[:2].tolist())
        gl.glUniform2f(device.place(program, "size"), *self._numbers[2:4].tolist())
        gl.glUniform4f(device.place(program, "stretch"), *self._numbers[4:].tolist())
        gl.glUniform1f(device.place(program, "most"), MOST)
        gl.glUniform1i(device.place(program, "places"), self._places)
        gl.glUniform1i(device.place(self._use("shade"), "width"), lens.width)
        program = self._use("gain")
        gl.glUniform1i(device.place(program, "width"), lens.width)
        gl.glUniform1i(device.place(program, "height"), lens.height)
        gl.glUniform1f(device.place(program, "target"), self._response.target)
        gl.glUniform1f(device.place(program, "fixed_gain"), self._response.gain or 0.0)
        gl.glUniform1f(device.place(program, "inertia"), self._response.inertia)
        gl.glUniform1i(device.place(self._use("develop"), "top"), self._top)


def _runs(stretches: np.ndarray, ends: np.ndarray) -> list[tuple[int, int]]:
    """Ranges that stretches next to each other make together."""
    if not len(stretches):
        return []
    parts = np.split(stretches, np.flatnonzero(np.diff(stretches) > 1) + 1)
    return [(int(ends[part[0]]), int(ends[part[-1] + 1])) for part in parts]
