"""OpenGL's functions as the driver has them: one call into it each, and nothing of Python's looks at what is given.

PyOpenGL turns every argument over, and asks the driver after every call whether it was right; a picture makes some
sixty calls. Here that is asked once a picture (`haustra.envs.view.picture.gl_device.GlDevice.check`).
"""

import ctypes
import importlib
from types import SimpleNamespace
from typing import Any

_KINDS: dict[str, Any] = {
    "i": ctypes.c_int,
    "u": ctypes.c_uint,
    "n": ctypes.c_ssize_t,
    "N": ctypes.c_uint64,
    "p": ctypes.c_void_p,
    "-": None,
}
_FUNCTIONS = {
    "glBindBuffer": "-uu",
    "glBindBufferBase": "-uuu",
    "glBindBuffersBase": "-uuip",
    "glBufferSubData": "-unnp",
    "glClientWaitSync": "upuN",
    "glCopyBufferSubData": "-uunnn",
    "glDeleteSync": "-p",
    "glDispatchCompute": "-uuu",
    "glDispatchComputeIndirect": "-n",
    "glFenceSync": "puu",
    "glFlush": "-",
    "glGetError": "u",
    "glMemoryBarrier": "-u",
    "glUniform1i": "-ii",
    "glUniform3fv": "-iip",
    "glUniform4fv": "-iip",
    "glUseProgram": "-u",
}
"""What each returns, and then what it is given, by the letters above."""


def gl_calls() -> SimpleNamespace:
    """The functions that a picture needs, by their names, of the context that is current."""
    platform, found = importlib.import_module("OpenGL.platform").PLATFORM, SimpleNamespace()
    for name, (result, *given) in _FUNCTIONS.items():
        address = platform.getExtensionProcedure(name.encode())
        setattr(found, name, ctypes.CFUNCTYPE(_KINDS[result], *(_KINDS[kind] for kind in given))(address))
    return found
