"""Pictures as files."""

from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from haustra.files import write_atomically


def write_png(path: Path, picture: UInt8[np.ndarray, "height width 3"]) -> Path:
    """Write a picture as PNG.

    Raises:
        OutputError: when the file cannot be written.
    """
    from PIL import Image

    return write_atomically(path, lambda temporary: Image.fromarray(picture).save(temporary, format="PNG"))
