"""An OpenGL device without a window: programs of compute shaders, buffers, and what they are given."""

import atexit
import ctypes
import importlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8, UInt32

from haustra.envs.view.picture.backends import best_backend
from haustra.envs.view.picture.gl_calls import gl_calls
from haustra.envs.view.picture.gl_shaders import GROUP
from haustra.errors import MissingDependencyError

_LEAST = 44
"""Compute shaders came with OpenGL 4.3, buffers that stay within the host's reach with 4.4."""
_NEVER = 10**11
"""What is not done after so many nanoseconds will never be."""
_CONTEXTS = {"egl": "mujoco.egl", "osmesa": "mujoco.osmesa", "glfw": "mujoco.glfw"}


class GlDevice:
    """One context, which stays current; others of the same thread must not be made current in between."""

    def __init__(self, width: int, height: int) -> None:
        """Begin.

        Raises:
            MissingDependencyError: when no OpenGL draws here, or one without compute shaders.
        """
        backend = best_backend()
        if backend is None:
            raise MissingDependencyError("OpenGL draws nothing here: install EGL, or use the rays, which need none.")
        self._context: Any = importlib.import_module(_CONTEXTS[backend]).GLContext(width, height)
        atexit.register(self._context.free)  # before the library itself ends, which then frees nothing any more
        self._context.make_current()
        self.gl: Any = importlib.import_module("OpenGL.GL")
        """PyOpenGL's functions."""
        gl = self.gl
        if 10 * gl.glGetIntegerv(gl.GL_MAJOR_VERSION) + gl.glGetIntegerv(gl.GL_MINOR_VERSION) < _LEAST:
            version = gl.glGetString(gl.GL_VERSION).decode()
            raise MissingDependencyError(f"OpenGL here is {version}, pictures need 4.4: use the rays, which need none.")
        self.name: str = gl.glGetString(gl.GL_RENDERER).decode()
        """What draws."""
        self.calls: Any = gl_calls()
        """The functions that are called for each picture."""
        self._asked = importlib.import_module("OpenGL.platform").PLATFORM.GetCurrentContext
        self._own = self._current()
        self._places: dict[tuple[int, str], int] = {}
        self._marks: list[tuple[str, int | None, int]] | None = None

    def make_current(self) -> None:
        """Let what follows go to this context; drivers take long over one that is current already."""
        if self._current() != self._own:
            self._context.make_current()

    def _current(self) -> Any:
        """Address of the context that is current."""
        found = self._asked()
        return getattr(found, "address", found)

    def check(self) -> None:
        """Ask whether the driver did all that it was called for.

        Raises:
            MissingDependencyError: when it did not.
        """
        if error := self.calls.glGetError():
            raise MissingDependencyError(f"OpenGL on {self.name} refuses a picture ({error:#x}): use the rays instead.")

    def close(self) -> None:
        """Give back all that it holds; nothing can be drawn any more."""
        atexit.unregister(self._context.free)
        self._context.free()

    def program(self, sources: Mapping[str, str]) -> int:
        """A program of shaders, by their stage."""
        gl = self.gl
        program = gl.glCreateProgram()
        for stage, text in sources.items():
            shader = gl.glCreateShader(getattr(gl, f"GL_{stage.upper()}_SHADER"))
            gl.glShaderSource(shader, text)
            gl.glCompileShader(shader)
            if not gl.glGetShaderiv(shader, gl.GL_COMPILE_STATUS):
                raise MissingDependencyError(
                    f"OpenGL's driver refuses a shader: {_said(gl.glGetShaderInfoLog(shader))}"
                )
            gl.glAttachShader(program, shader)
        gl.glLinkProgram(program)
        if not gl.glGetProgramiv(program, gl.GL_LINK_STATUS):
            raise MissingDependencyError(f"OpenGL refuses a program: {_said(gl.glGetProgramInfoLog(program))}")
        return program

    def place(self, program: int, name: str) -> int:
        """Where a program's uniform is; -1 where it has none of that name."""
        if (program, name) not in self._places:
            self._places[program, name] = self.gl.glGetUniformLocation(program, name)
        return self._places[program, name]

    def buffer(self, values: np.ndarray, use: str = "STATIC_DRAW") -> int:
        """A buffer with these numbers, where the driver finds it best for OpenGL's use of that name."""
        gl = self.gl
        held = int(gl.glGenBuffers(1))
        gl.glBindBuffer(gl.GL_SHADER_STORAGE_BUFFER, held)
        values = np.ascontiguousarray(values)
        gl.glBufferData(gl.GL_SHADER_STORAGE_BUFFER, max(values.nbytes, 16), None, getattr(gl, f"GL_{use}"))
        if values.nbytes:
            self.write(held, values)
        return held

    def write(self, held: int, values: np.ndarray) -> None:
        """Put numbers, which lie in their order, at the beginning of a buffer."""
        assert values.flags.c_contiguous
        self.calls.glBindBuffer(self.gl.GL_SHADER_STORAGE_BUFFER, held)
        self.calls.glBufferSubData(self.gl.GL_SHADER_STORAGE_BUFFER, 0, values.nbytes, values.ctypes.data)

    def read(self, held: int, out: np.ndarray) -> None:
        """Copy numbers from the beginning of a buffer, when all that writes them is done."""
        gl = self.gl
        gl.glBindBuffer(gl.GL_SHADER_STORAGE_BUFFER, held)
        gl.glGetBufferSubData(gl.GL_SHADER_STORAGE_BUFFER, 0, out.nbytes, out.ctypes.data_as(ctypes.c_void_p))

    def use(self, program: int, buffers: UInt32[np.ndarray, " buffers"]) -> None:
        """Let the program run next, with these buffers in their order."""
        self.calls.glUseProgram(program)
        self.calls.glBindBuffersBase(self.gl.GL_SHADER_STORAGE_BUFFER, 0, len(buffers), buffers.ctypes.data)

    def over(self, program: int, ranges: Sequence[Sequence[int]]) -> None:
        """Run the program in use over things from a first one to before a last one, range after range."""
        calls, first_at, last_at = self.calls, self.place(program, "first"), self.place(program, "last")
        for first, last in ranges:
            calls.glUniform1i(first_at, first)
            calls.glUniform1i(last_at, last)
            calls.glDispatchCompute(-(-(last - first) // GROUP), 1, 1)
        calls.glMemoryBarrier(self.gl.GL_SHADER_STORAGE_BARRIER_BIT)

    def groups(self, count: int) -> None:
        """Run the program in use in so many groups."""
        self.calls.glDispatchCompute(count, 1, 1)
        self.calls.glMemoryBarrier(self.gl.GL_SHADER_STORAGE_BARRIER_BIT)

    def groups_of(self, held: int) -> None:
        """Run the program in use in as many groups as the second to fourth number of a buffer say."""
        gl, calls = self.gl, self.calls
        calls.glBindBuffer(gl.GL_DISPATCH_INDIRECT_BUFFER, held)
        calls.glMemoryBarrier(gl.GL_COMMAND_BARRIER_BIT)
        calls.glDispatchComputeIndirect(4)
        calls.glMemoryBarrier(gl.GL_SHADER_STORAGE_BARRIER_BIT)

    def mark(self, part: str) -> None:
        """A part of a picture begins here, if it is timed: by the device's clock, or the host's where it has none."""
        if self._marks is None:
            return
        gl = self.gl
        if not gl.glQueryCounter:  # of OSMesa
            gl.glFinish()
            self._marks.append((part, None, time.perf_counter_ns()))
            return
        query = int(np.ravel(gl.glGenQueries(1))[0])
        gl.glQueryCounter(query, gl.GL_TIMESTAMP)
        self._marks.append((part, query, 0))

    def timed(self, work: Callable[[], object]) -> dict[str, float]:
        """How long the parts of some work took on the device, one after the other, by their names [s]."""
        self._marks = []
        work()
        self.mark("")
        marks, self._marks = self._marks, None
        times = [now if query is None else self._told(query) for _, query, now in marks]
        return {part: 1e-9 * (end - begin) for (part, *_), begin, end in zip(marks, times, times[1:], strict=False)}

    def _told(self, query: int) -> int:
        raw = importlib.import_module("OpenGL.raw.GL.VERSION.GL_3_3")  # PyOpenGL's own wrapper knows no such numbers
        found = ctypes.c_uint64()
        raw.glGetQueryObjectui64v(query, self.gl.GL_QUERY_RESULT, ctypes.byref(found))
        self.gl.glDeleteQueries(1, [query])
        return found.value


class HostCopy:
    """Room in the host's memory into which the device copies the beginning of a buffer, while other work goes on."""

    def __init__(self, device: GlDevice, size: int) -> None:
        """For so many bytes."""
        gl, self._device = device.gl, device
        self._held, self._fence = int(gl.glGenBuffers(1)), None
        flags = gl.GL_MAP_READ_BIT | gl.GL_MAP_PERSISTENT_BIT | gl.GL_MAP_COHERENT_BIT
        gl.glBindBuffer(gl.GL_COPY_WRITE_BUFFER, self._held)
        gl.glBufferStorage(gl.GL_COPY_WRITE_BUFFER, size, None, flags | gl.GL_CLIENT_STORAGE_BIT)
        address = gl.glMapBufferRange(gl.GL_COPY_WRITE_BUFFER, 0, size, flags)
        self._bytes = np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(ctypes.c_uint8)), (size,))

    def begin(self, source: int) -> None:
        """Copy from that buffer, as soon as all that writes it is done."""
        gl, calls = self._device.gl, self._device.calls
        if self._fence is not None:
            calls.glDeleteSync(self._fence)
        calls.glMemoryBarrier(gl.GL_BUFFER_UPDATE_BARRIER_BIT)
        calls.glBindBuffer(gl.GL_COPY_READ_BUFFER, source)
        calls.glBindBuffer(gl.GL_COPY_WRITE_BUFFER, self._held)
        calls.glCopyBufferSubData(gl.GL_COPY_READ_BUFFER, gl.GL_COPY_WRITE_BUFFER, 0, 0, len(self._bytes))
        calls.glMemoryBarrier(gl.GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT)
        self._fence = calls.glFenceSync(gl.GL_SYNC_GPU_COMMANDS_COMPLETE, 0)
        calls.glFlush()
        self._device.check()

    def bytes(self) -> UInt8[np.ndarray, " bytes"]:
        """What was copied, when it is there; changed by the next copy.

        Raises:
            MissingDependencyError: when the driver does not finish.
        """
        gl = self._device.gl
        done = self._device.calls.glClientWaitSync(self._fence, gl.GL_SYNC_FLUSH_COMMANDS_BIT, _NEVER)
        if done not in (gl.GL_ALREADY_SIGNALED, gl.GL_CONDITION_SATISFIED):
            raise MissingDependencyError(f"OpenGL on {self._device.name} finished no picture: use the rays instead.")
        return self._bytes


def _said(log: Any) -> str:
    text = log.decode() if isinstance(log, bytes) else str(log)
    return " ".join(text.split())[:300]
