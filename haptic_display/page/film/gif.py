# SPDX-License-Identifier: Apache-2.0
"""A film as a GIF, for where no page can be shown."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.animation import PillowWriter
from matplotlib.figure import Figure

from haptic_device.os_errors import naming
from haptic_device.theory import palette
from haptic_display.page.film.reading import Film
from haptic_sim.scene.drawing import shapes_of
from haptic_sim.scene.paint import paint

PERIOD = 0.08  # [s] of a picture, a whole number of the format's hundredths
RATE: Any = 1.0 / PERIOD  # matplotlib takes fractions too, but says that it does not
SECONDS = 5.76  # at most, unless more is asked for
BEFORE = 1.0  # [s] that are shown before the first contact
SIZE, DPI = (4.8, 3.6), 100  # inches
SIDES = np.array([-1.0, 1.0])


class _Writer(PillowWriter):
    _frames: list[Any]

    def finish(self) -> None:
        """One palette for all pictures, of that with most colours: a file half as large, in half the time."""
        richest = max(self._frames, key=lambda frame: len(frame.getcolors(frame.width * frame.height)))
        colours = richest.quantize()
        self._frames = [frame.quantize(palette=colours, dither=0) for frame in self._frames]
        super().finish()


def pictures_of(film: Film, seconds: float = SECONDS) -> npt.NDArray[np.intp]:
    """Which pictures of the film are in a GIF of at most so many seconds: its first contact, or its beginning."""
    length = (film.pictures - 1) / film.rate
    contact = film.begin if film.first_contact is None else film.first_contact
    begin = max(0.0, min(contact - BEFORE - film.begin, length - seconds))
    times = begin + PERIOD * np.arange(round(min(seconds, length + PERIOD) / PERIOD))
    found = np.round(times[times <= length + 1e-9] * film.rate).astype(np.intp)
    return np.minimum(found, film.pictures - 1)


def write_gif(film: Film, path: Path, seconds: float = SECONDS) -> None:
    """Writes at most so many seconds of it, in real time and over and over."""
    figure, writer = Figure(SIZE, facecolor=palette.GROUND), _Writer(RATE)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), aspect="equal")
    low, high = np.reshape(film.room, (2, 2)) * 1e3
    half = np.max((high - low) / SIZE) / 2.0 * np.array(SIZE)
    axes.set(xlim=(low + high)[0] / 2.0 + half[0] * SIDES, ylim=(low + high)[1] / 2.0 + half[1] * SIDES)
    axes.set_axis_off()
    said = axes.text(0.015, 0.95, "", transform=axes.transAxes, fontsize=11, va="center", zorder=9)
    with naming(path), writer.saving(figure, path, DPI):
        for number in pictures_of(film, seconds):
            for artist in (*axes.patches, *axes.lines, *axes.texts[1:]):
                artist.remove()
            for shape in shapes_of(film.scene, film.frame(int(number)), film.walls):
                paint(axes, shape, 1.0)
            force = math.hypot(*film.force[number])
            felt = f"   {force:.1f} N" if math.isfinite(force) else ""
            said.set_text(f"{film.begin + number / film.rate:.1f} s{felt}")
            writer.grab_frame()
