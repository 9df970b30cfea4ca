"""The endoscope's picture by OpenGL: the same wall, lens, light and looks as by exact rays, on a graphics processor.

    scope = GlEndoscope(colon, lens, surface=surface)
    scope.picture(pose)                            # red, green, blue
    scope.distance()                               # along the rays of that picture [m]

All is compute shaders: graphics processors for computing rasterise with a small part of themselves only. Vertices are
taken along with the colon and kept off the device there, so that a picture sends some numbers for each node of the axis
and brings back bytes. Each triangle asks the rays of the pixels about its corners, exactly, and the nearest is kept.
A picture may be fetched while the next is drawn:

    one = scope.draw(pose)
    other = scope.draw(next_pose)
    scope.fetch(one)
"""

import numpy as np
from jaxtyping import Float, Int, UInt8, UInt32

from haustra.envs.view.picture import gl_shaders, mucosa
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.gl_device import GlDevice, HostCopy
from haustra.envs.view.picture.gl_shaders import FOUR, NONE, SPARSE
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
    **dict.fromkeys(
        ("local", "image", "normals", "nearest", "own", "large", "light", "gain", "bright", "picture"), "DYNAMIC_COPY"
    ),
}
"""What buffers that change are for, by OpenGL's names: sent for each picture, worked on by shaders."""
_BUFFERS = {
    "carry": ("axis", "lever", "arcs", "nodes", "device", "local", "image", "radii"),
    "normals": ("local", "faces", "starts", "around", "normals"),
    "nearest": ("local", "image", "faces", "lens", "nearest", "own", "large", "radii"),
    "shade": ("local", "faces", "nearest", "own", "normals", "wall", "lens", "light"),
    "gain": ("light", "gain", "bright", "large"),
    "develop": ("light", "gain", "curve", "picture"),
}
"""What each program is given, in its order."""


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
            "nearest": {"compute": gl_shaders.write_nearest()},
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
            "image": np.zeros((count, 2), np.float32),
            "faces": own.faces,
            "starts": starts,
            "around": around,
            "normals": np.zeros((count, 4), np.float32),
            "wall": self.appearance.wall,
            "lens": np.moveaxis(planes, 0, -1).astype(np.float32),
            "nearest": np.full(pixels, NONE, np.uint32),
            "own": np.full(pixels, NONE, np.uint32),
            "large": np.concatenate([[0, 0, 1, 1], np.zeros(len(own.faces))]).astype(np.uint32),
            "light": np.zeros((pixels, 4), np.float32),
            "gain": np.zeros(2, np.float32),
            "bright": np.zeros(-(-lens.width // SPARSE) * -(-lens.height // SPARSE), np.uint32),
            "curve": curve.astype(np.uint32),
            "picture": np.zeros(3 * -(-pixels // FOUR), np.uint32),
            "radii": radii(lens).astype(np.float32),
        }
        self._held = {name: device.buffer(values, _USES.get(name, "STATIC_DRAW")) for name, values in held.items()}
        self._copies = [HostCopy(device, 3 * pixels) for _ in range(2)]
        self._drawn, self._top = 0, len(curve) - 1
        numbers = np.zeros(4 * (SHARED + 3 * guides + 7 * len(self.appearance.kinds)), np.float32)
        self._held["common"] = device.buffer(numbers, "STREAM_DRAW")
        self._held["device"] = device.buffer(np.zeros(8, np.float32))
        self._places = np.zeros((1, 8), np.float32)
        self._nodes, self._camera = held["nodes"], np.zeros(24, np.float32)
        self._bound = {name: self._buffers(name) for name in _BUFFERS}
        self._widest = np.radians(min(lens.field_of_view_deg, 250.0)) / 2
        self._placings = -1
        self._low = np.minimum.reduceat(own.arcs, own.ends[:-1])
        self._high = np.maximum.reduceat(own.arcs, own.ends[:-1])
        self._lattice()
        self._standing(len(held["radii"]))

    def picture(self, pose: CameraPose) -> UInt8[np.ndarray, "height width 3"]:
        """The picture in colour."""
        return self.fetch(self.draw(pose))

    def fetch(self, which: int) -> UInt8[np.ndarray, "height width 3"]:
        """A picture that was drawn, when it is done: the last, or the one before."""
        assert 0 <= self._drawn - which < len(self._copies), "pictures before the last two are gone"
        self.device.make_current()
        found = self._copies[which % len(self._copies)].bytes()
        return found.reshape(self.lens.height, self.lens.width, 3).copy()

    def part_times(self, pose: CameraPose) -> dict[str, float]:
        """Time that the parts of a picture take on the device, by their names [s]."""
        return self.device.timed(lambda: self.draw(pose))

    def distance(self) -> Float[np.ndarray, "height width"]:
        """Along the rays of the last picture [m]; infinite where they meet nothing."""
        light = np.empty((self.lens.height, self.lens.width, 4), np.float32)
        self.device.make_current()
        self.device.read(self._held["light"], light)
        return np.where(light[..., 3] > 0, light[..., 3], np.inf)

    def radiance(self) -> Float[np.ndarray, "height width 3"]:
        """Light of the last picture, before exposure (`haustra.envs.view.picture.endoscope.Endoscope.radiance`)."""
        light = np.empty((self.lens.height, self.lens.width, 4), np.float32)
        self.device.make_current()
        self.device.read(self._held["light"], light)
        return light[..., :3]

    def bleed(self, place: Float[np.ndarray, "3"], reach: float) -> None:
        """Let blood lie on the wall (`haustra.envs.view.picture.appearance.Appearance.bleed`)."""
        self.appearance.bleed(place, reach)
        self.device.make_current()
        self.device.write(self._held["wall"], self.appearance.wall)

    def draw(self, pose: CameraPose) -> int:
        """Draw, and let the picture come: does not wait for it, and the surface may move on.

        Returns:
            Which picture it is, for `fetch`.
        """
        from haustra.envs.view.picture import kernels

        device, surface, held = self.device, self.surface, self._held
        gl, calls = device.gl, device.calls
        device.make_current()
        if self._placings != surface.placings:
            self._send_skin()
        shown, needed = self._in_sight(pose)
        vertices = kernels.runs(needed, surface.ends).tolist()
        triangles = kernels.runs(shown, surface.face_ends).tolist()
        pixels = self.lens.width * self.lens.height
        device.mark("surface")
        self._take_along(pose, needed)
        device.over(self._programs["carry"], vertices)
        device.over(self._use("normals"), vertices)
        device.mark("nearest")
        program = self._use("nearest")
        stage = device.place(program, "stage")
        for bit in range(2):
            calls.glUniform1i(stage, bit)
            device.over(program, triangles)
            calls.glUniform1i(stage, 2 + bit)
            device.groups_of(held["large"])
        device.mark("shading")
        device.write(held["common"], common_numbers(self.appearance, pose, self._light, self._pixel))
        program = self._use("shade")
        calls.glBindBufferBase(gl.GL_UNIFORM_BUFFER, 0, held["common"])
        device.over(program, [(0, pixels)])
        device.mark("exposure")
        self._use("gain")
        device.groups(1)
        device.over(self._use("develop"), [(0, -(-pixels // FOUR))])
        device.mark("copy")
        self._drawn += 1
        self._copies[self._drawn % len(self._copies)].begin(held["picture"])
        return self._drawn

    def _use(self, name: str) -> int:
        program = self._programs[name]
        self.device.use(program, self._bound[name])
        return program

    def _buffers(self, name: str) -> UInt32[np.ndarray, " buffers"]:
        return np.array([self._held[each] for each in _BUFFERS[name]], np.uint32)

    def _take_along(self, pose: CameraPose, stretches: Int[np.ndarray, " some"]) -> None:
        """Say where the axis, the device and the camera are."""
        device, calls, posture = self.device, self.device.calls, self.surface.posture()
        self._nodes[:] = posture.nodes
        device.write(self._held["nodes"], self._nodes)
        count = self._send_device(stretches)
        camera, own = self._camera, self._camera.ctypes.data
        camera[:3], camera[3:12], camera[12:] = pose.position, pose.rotation.T.ravel(), posture.axes.ravel()
        program = self._use("carry")
        calls.glUniform1i(device.place(program, "places"), count)
        calls.glUniform3fv(device.place(program, "eye"), 1, own)
        calls.glUniform3fv(device.place(program, "sides"), 3, own + camera[:3].nbytes)
        calls.glUniform4fv(device.place(program, "world"), 3, own + camera[:12].nbytes)

    def _in_sight(self, pose: CameraPose) -> tuple[Int[np.ndarray, " some"], Int[np.ndarray, " more"]]:
        """Stretches whose triangles the camera may see, and those that hold all vertices about them."""
        from haustra.envs.view.picture import kernels

        eye, axes = np.ascontiguousarray(pose.position, float), np.ascontiguousarray(pose.rotation, float)
        shown = kernels.in_sight(*self.surface.balls(), eye, axes, _BEYOND, self._widest, REACH / STRETCH)
        return shown, self.surface.needed(shown)

    def _send_skin(self) -> None:
        skin = self.surface.skin()
        for name, three, one in (("axis", skin.axis, skin.node), ("lever", skin.lever, skin.share)):
            self.device.write(self._held[name], np.column_stack([three, one]).astype(np.float32))
        self._placings = self.surface.placings

    def _send_device(self, stretches: Int[np.ndarray, " some"]) -> int:
        """Places of the device that may push what is drawn; how many there are."""
        own = self.surface.device
        if own is None or not len(stretches):
            return 0
        from haustra.envs.view.picture import kernels

        low, high = self._low[stretches].min(), self._high[stretches].max()
        if len(own.arcs) > len(self._places):
            self._places = np.zeros((2 * len(own.arcs), 8), np.float32)
            self._held["device"] = self.device.buffer(self._places, "STREAM_DRAW")
            self._bound["carry"] = self._buffers("carry")
        count = kernels.near_places(*own, low, high, FALL, self._places)
        self.device.write(self._held["device"], self._places[:count])
        return count

    def _lattice(self) -> None:
        """The random numbers of all patterns, as a texture."""
        gl, lattice = self.device.gl, int(self.device.gl.glGenTextures(1))
        rows = mucosa.corners(self.appearance.lattice).astype(np.float32)
        gl.glBindTexture(gl.GL_TEXTURE_2D, lattice)
        gl.glTexImage2D(gl.GL_TEXTURE_2D, 0, gl.GL_RGBA32F, 256, len(rows) // 256, 0, gl.GL_RGBA, gl.GL_FLOAT, rows)
        for side in (gl.GL_TEXTURE_MIN_FILTER, gl.GL_TEXTURE_MAG_FILTER):
            gl.glTexParameteri(gl.GL_TEXTURE_2D, side, gl.GL_NEAREST)

    def _standing(self, radius_count: int) -> None:
        """What stays as it is from picture to picture."""
        gl, device, lens = self.device.gl, self.device, self.lens
        self._pixel = pixel_angle(lens)
        for name in ("carry", "nearest"):
            program = self._use(name)
            gl.glUniform2f(device.place(program, "centre"), *lens.centre)
            gl.glUniform4f(device.place(program, "stretch"), *np.ravel(lens.stretch).tolist())
            gl.glUniform1f(device.place(program, "most"), MOST)
            gl.glUniform1i(device.place(program, "radius_count"), radius_count)
        gl.glUniform2i(device.place(program, "size"), lens.width, lens.height)
        gl.glUniform1f(device.place(program, "widest"), float(np.tan(self._widest / 2)))
        program = self._use("gain")
        gl.glUniform1i(device.place(program, "width"), lens.width)
        gl.glUniform1i(device.place(program, "height"), lens.height)
        gl.glUniform1f(device.place(program, "target"), self._response.target)
        gl.glUniform1f(device.place(program, "fixed_gain"), self._response.gain or 0.0)
        gl.glUniform1f(device.place(program, "inertia"), self._response.inertia)
        program = self._use("develop")
        gl.glUniform1i(device.place(program, "top"), self._top)
        gl.glUniform1i(device.place(program, "pixels"), lens.width * lens.height)
