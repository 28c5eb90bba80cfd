# SPDX-License-Identifier: Apache-2.0
"""The web page on which the mouse is the hand: a process of its own, which only looks at topics made for people."""

from functools import partial

from haptic_device.process import start

haptic_viewer = partial(start, "haptic_display.page.viewer")
