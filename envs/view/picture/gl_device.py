"""An OpenGL device that draws without a window: programs of shaders, buffers, and what they are given."""

import atexit
import ctypes
import importlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from haustra.envs.view.picture.backends import best_backend
from haustra.envs.view.picture.gl_shaders import GROUP
from haustra.errors import MissingDependencyError

_LEAST = 43
"""Compute shaders came with OpenGL 4.3."""
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
            raise MissingDependencyError(f"OpenGL here is {version}, pictures need 4.3: use the rays, which need none.")
        self.name: str = gl.glGetString(gl.GL_RENDERER).decode()
        """What draws."""
        self._places: dict[tuple[int, str], int] = {}

    def make_current(self) -> None:
        """Let what follows go to this context."""
        self._context.make_current()

    def close(self) -> None:
        """Give back all that it holds; nothing can be drawn any more."""
        atexit.unregister(self._context.free)
        self._context.free()

    def program(self, sources: Mapping[str, str]) -> int:
        """A program of shaders, by their stage: compute, vertex, fragment."""
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
        """Put numbers at the beginning of a buffer."""
        gl = self.gl
        gl.glBindBuffer(gl.GL_SHADER_STORAGE_BUFFER, held)
        gl.glBufferSubData(gl.GL_SHADER_STORAGE_BUFFER, 0, values.nbytes, np.ascontiguousarray(values))

    def read(self, held: int, out: np.ndarray) -> None:
        """Copy numbers from the beginning of a buffer, when all that writes them is done."""
        gl = self.gl
        gl.glBindBuffer(gl.GL_SHADER_STORAGE_BUFFER, held)
        gl.glGetBufferSubData(gl.GL_SHADER_STORAGE_BUFFER, 0, out.nbytes, out.ctypes.data_as(ctypes.c_void_p))

    def bind(self, buffers: Sequence[int]) -> None:
        """Let programs have these buffers, in their order."""
        gl = self.gl
        for binding, held in enumerate(buffers):
            gl.glBindBufferBase(gl.GL_SHADER_STORAGE_BUFFER, binding, held)

    def over(self, program: int, ranges: Sequence[tuple[int, int]]) -> None:
        """Run the program in use over things from a first one to before a last one, range after range."""
        gl = self.gl
        first_at, last_at = self.place(program, "first"), self.place(program, "last")
        for first, last in ranges:
            gl.glUniform1i(first_at, first)
            gl.glUniform1i(last_at, last)
            gl.glDispatchCompute(-(-(last - first) // GROUP), 1, 1)
        gl.glMemoryBarrier(gl.GL_ALL_BARRIER_BITS)


def _said(log: Any) -> str:
    text = log.decode() if isinstance(log, bytes) else str(log)
    return " ".join(text.split())[:300]
