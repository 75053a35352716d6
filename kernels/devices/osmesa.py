"""An OpenGL context that renders into main memory: Mesa's OSMesa library through ctypes.

moderngl takes any object with these methods as a context.
"""

from __future__ import annotations

import ctypes
import ctypes.util
from typing import Any

ATTRIBUTES = (
    *(0x22, 0x1908),  # OSMESA_FORMAT: OSMESA_RGBA
    *(0x33, 0x34),  # OSMESA_PROFILE: OSMESA_CORE_PROFILE
    *(0x36, 3),  # OSMESA_CONTEXT_MAJOR_VERSION
    *(0x37, 3),  # OSMESA_CONTEXT_MINOR_VERSION
    0,
)
"""An OpenGL 3.3 core context, in the numbers of GL/osmesa.h; the list ends with 0."""

GL_UNSIGNED_BYTE = 0x1401
"""Type of the default buffer's numbers, in the numbers of GL/gl.h."""

LIBRARIES = ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
"""Names under which the library is looked for."""


class OSMesaContext:
    """A context with a default buffer of one pixel; all drawing goes to framebuffer objects."""

    def __init__(self) -> None:
        self._library = _load()
        attributes = (ctypes.c_int * len(ATTRIBUTES))(*ATTRIBUTES)
        self._handle = self._library.OSMesaCreateContextAttribs(attributes, None)
        if not self._handle:
            raise OSError("OSMesa gives no OpenGL 3.3 core context")
        self._pixel = (ctypes.c_ubyte * 4)()
        self.__enter__()

    def load_opengl_function(self, name: str) -> int:
        """Return the address of an OpenGL function, 0 when there is none."""
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def __enter__(self) -> OSMesaContext:
        if not self._library.OSMesaMakeCurrent(self._handle, self._pixel, GL_UNSIGNED_BYTE, 1, 1):
            raise OSError("OSMesa does not make its context current")
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the context current: OSMesa has no way to have none, and the next one replaces it."""

    def release(self) -> None:
        """Destroy the context."""
        if self._handle:
            self._library.OSMesaDestroyContext(self._handle)
            self._handle = None


def _load() -> Any:
    """Return the library with the signatures of the functions in use."""
    for name in (*LIBRARIES, ctypes.util.find_library("OSMesa")):
        try:
            library = ctypes.CDLL(name) if name else None
        except OSError:
            continue
        if library is not None:
            break
    else:
        raise OSError(f"no library {LIBRARIES[0]}")
    library.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
    library.OSMesaCreateContextAttribs.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    library.OSMesaMakeCurrent.argtypes = [
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_uint,
        ctypes.c_int,
        ctypes.c_int,
    ]
    library.OSMesaGetProcAddress.restype = ctypes.c_void_p
    library.OSMesaGetProcAddress.argtypes = [ctypes.c_char_p]
    library.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
    return library
