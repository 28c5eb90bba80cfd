# SPDX-License-Identifier: Apache-2.0
"""A film as a GIF, for where no page can be shown."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from haptic_device.analysis import palette
from haptic_device.os_errors import naming
from haptic_sim.film.clock import Array
from haptic_sim.film.curves import HANDLE
from haptic_sim.film.reading import Film
from haptic_sim.scene.geometry import Outline, Point, Pose, thickness, turned
from haptic_sim.scene.shapes import TOOL

PERIOD = 0.08  # [s] of a picture, a whole number of the format's hundredths
SECONDS = 5.76  # at most, unless more is asked for
THIN = 3.0  # pixels: a body that is thinner is drawn wider
BEFORE = 1.0  # [s] that are shown before the first contact
SIZE = (480, 360)  # pixels
FINER = 2  # drawn larger by this, then reduced: soft edges
COLOURS = 48
PER_NEWTON = 6.0  # pixels
LONGEST = 140.0  # pixels of an arrow


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
    drawer = _Drawer(film)
    frames = [drawer.picture(int(number)) for number in pictures_of(film, seconds)]
    colours = frames[len(frames) // 2].quantize(COLOURS)
    reduced = [frame.quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames]
    with naming(path):
        reduced[0].save(
            path, save_all=True, append_images=reduced[1:], duration=round(1e3 * PERIOD), loop=0, optimize=True
        )


class _Drawer:
    """Draws the pictures of one film."""

    def __init__(self, film: Film) -> None:
        self._film, (left, bottom, right, top) = film, film.room
        width, height = (FINER * side for side in SIZE)
        self._scale = min(width / (right - left), height / (top - bottom))
        self._middle, self._half = ((left + right) / 2, (bottom + top) / 2), (width / 2, height / 2)
        self._still = Image.new("RGB", (width, height), palette.GROUND)
        draw = ImageDraw.Draw(self._still)
        for normal_x, normal_y, offset in film.walls:
            self._wall(draw, normal_x, normal_y, offset)
        for solid in film.scene.solids if film.scene else ():
            if solid.fixed:
                self._solid(draw, solid.outlines, solid.pose, palette.FIXED)

    def picture(self, number: int) -> Image.Image:
        """One picture in the size of the GIF."""
        film, picture = self._film, self._still.copy()
        draw, places = ImageDraw.Draw(picture), {name: _known(place[number]) for name, place in film.places.items()}
        for solid in film.scene.solids[1:] if film.scene else ():
            if not solid.fixed and (pose := places.get(solid.name)):
                self._solid(draw, solid.outlines, pose, palette.MOVING)
        tool, handle = places.get(TOOL), places.get(HANDLE)
        if film.scene and tool:
            x, y = np.mean(film.scene.solids[0].outlines[0].vertices, axis=0).tolist()
            draw.line([self._pixels(tool), self._pixels(turned((x, y), tool))], palette.INK, 2 * FINER)
            self._solid(draw, film.scene.solids[0].outlines, tool, palette.TOOL)
        if tool and handle and film.coupled[number]:
            draw.line([self._pixels(handle), self._pixels(tool)], palette.COUPLING, 4 * FINER)
        for at, x, y, *force in film.contacts:
            if at == number:
                self._disc(draw, (x, y), 3.5 * FINER, palette.CONTACT)
                self._arrow(draw, (x, y), force, palette.CONTACT)
        if handle:
            self._arrow(draw, handle, film.force[number].tolist(), palette.FORCE)
            self._disc(draw, handle, 6 * FINER, palette.HANDLE)
        self._label(draw, number)
        return picture.resize(SIZE, Image.Resampling.BOX)

    def _label(self, draw: ImageDraw.ImageDraw, number: int) -> None:
        force = math.hypot(*self._film.force[number])
        felt = f"   {force:.1f} N" if math.isfinite(force) else ""
        draw.text(
            (8 * FINER, 6 * FINER),
            f"{self._film.begin + number / self._film.rate:.1f} s{felt}",
            palette.INK,
            font_size=15 * FINER,
        )

    def _pixels(self, place: Sequence[float]) -> Point:
        (x, y), (cx, cy), (half_width, half_height) = place[:2], self._middle, self._half
        return half_width + (x - cx) * self._scale, half_height - (y - cy) * self._scale

    def _solid(self, draw: ImageDraw.ImageDraw, outlines: tuple[Outline, ...], pose: Pose, colour: str) -> None:
        for vertices, radius in outlines:
            corners = [turned(vertex, pose) for vertex in vertices]
            if radius > 0.0:
                self._disc(draw, corners[0], radius * self._scale, colour)
                continue
            places = [self._pixels(corner) for corner in corners]
            draw.polygon(places, colour, palette.INK, FINER)
            if thickness(Outline(vertices, radius)) * self._scale < THIN * FINER:
                draw.line([*places, places[0]], colour, round(THIN * FINER))

    def _wall(self, draw: ImageDraw.ImageDraw, normal_x: float, normal_y: float, offset: float) -> None:
        far = 2.0  # m
        foot, along = (normal_x * offset, normal_y * offset), (-normal_y * far, normal_x * far)
        deep = (-normal_x * far, -normal_y * far)
        ends = [(foot[0] + s * along[0], foot[1] + s * along[1]) for s in (1, -1)]
        corners = [*ends, *((x + deep[0], y + deep[1]) for x, y in reversed(ends))]
        draw.polygon([self._pixels(corner) for corner in corners], palette.WALL)

    def _disc(self, draw: ImageDraw.ImageDraw, place: Sequence[float], radius: float, colour: str) -> None:
        x, y = self._pixels(place)
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], colour, palette.INK, FINER)

    def _arrow(self, draw: ImageDraw.ImageDraw, place: Sequence[float], force: Sequence[float], colour: str) -> None:
        size = math.hypot(*force)
        if not size * PER_NEWTON > 1.0:  # nor is one drawn that is no number
            return
        length = FINER * min(LONGEST, PER_NEWTON * size)
        (x, y), (ux, uy) = self._pixels(place), (force[0] / size, -force[1] / size)
        tip, head = (x + ux * length, y + uy * length), min(length, 9 * FINER)
        back = tip[0] - ux * head, tip[1] - uy * head
        side = -uy * head / 2, ux * head / 2
        draw.line([(x, y), back], colour, 3 * FINER)
        draw.polygon([tip, (back[0] + side[0], back[1] + side[1]), (back[0] - side[0], back[1] - side[1])], colour)


def _known(place: Array) -> Pose | None:
    x, y, angle = place.tolist()
    return (x, y, angle) if np.isfinite(place).all() else None
