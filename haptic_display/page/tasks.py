# SPDX-License-Identifier: Apache-2.0
"""The scenes that have a task, in the order in which one leads to the next."""

import functools

from haptic_device.config.files import names
from haptic_sim.scene.language import SceneError, load

FIRST = "peg_in_hole"


def tasks() -> list[dict[str, str]]:
    """`name` and `title` of each scene with a task."""
    titles, following = _known(tuple(names("scenes")))
    order, name = [], FIRST
    while name in titles and name not in order:
        order.append(name)
        name = following[name]
    return [{"name": name, "title": titles[name]} for name in (*order, *sorted(titles.keys() - order))]


@functools.cache
def _known(scenes: tuple[str, ...]) -> tuple[dict[str, str], dict[str, str]]:
    """Titles by name, and the scenes that follow; a file that holds no scene says so to whoever loads it."""
    titles, following = {}, {}
    for name in scenes:
        try:
            task = load(name).task
        except SceneError:
            continue
        if task:
            titles[name], following[name] = task.title, task.next
    return titles, following
