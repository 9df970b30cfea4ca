"""A window that shows pictures as they come; on a machine without a display it draws into memory."""

import warnings

import numpy as np
from jaxtyping import UInt8


class Window:
    """One picture at a time."""

    def __init__(self, title: str) -> None:
        """Open it."""
        from matplotlib import pyplot

        self._pyplot = pyplot
        self._figure, axes = pyplot.subplots(num=title, figsize=(4, 4))
        self._axes, self._image = axes, None
        axes.set_axis_off()

    def show(self, picture: UInt8[np.ndarray, "rows columns 3"]) -> None:
        """Replace the picture."""
        if self._image is None:
            self._image = self._axes.imshow(picture)
        self._image.set_data(picture)
        self._figure.canvas.draw_idle()
        with warnings.catch_warnings():  # a canvas in memory has no events to wait for, and says so
            warnings.simplefilter("ignore", UserWarning)
            self._figure.canvas.flush_events()

    def close(self) -> None:
        """Close it."""
        self._pyplot.close(self._figure)
