# SPDX-License-Identifier: Apache-2.0
"""Listens to a connected device: its page, what bridge and driver say, and the driver's `encoder`."""

import time

from haptic_device.nodes.messages import LATEST
from haptic_device.realtime.shared_memory import file_name
from haptic_device.recording.layouts import JOINTS
from haptic_device.recording.status import Status
from haptic_display.client import Client
from haptic_display.device_tools import figures as device_figures
from haptic_display.device_tools.device_page import glance
from haptic_display.run.processes import NAMESPACE

FRESH = 2.0  # [s] that what was heard counts


class DeviceWatch:
    """Of one display, on a node of its own, which leaves the network with `close`."""

    def __init__(self, domain: int, namespace: str | None = None):
        self._client = Client.join("haptic_device_show", domain, namespace or NAMESPACE)
        self._encoder = self._client.subscribe("encoder", JOINTS, LATEST)
        self._page = file_name(domain, namespace or NAMESPACE)
        self._position, self._heard = dict[str, float](), float("-inf")

    def close(self) -> None:
        """Leaves the network."""
        self._client.close()

    def look(self) -> None:
        """Takes what has come."""
        self._client.look()
        if (sample := self._encoder.latest()) is not None:
            said = sample.message
            self._position, self._heard = dict(zip(said.name, said.position, strict=False)), time.monotonic()

    def figures(self) -> dict[str, tuple[str, str]]:
        """{figure: (value, unit)}, as device_figures has it."""
        position = self._position if time.monotonic() - self._heard < FRESH else {}
        return device_figures.figures(self._fresh(), glance(self._page), position)

    def answering(self) -> bool:
        """Whether a device answers there now."""
        return device_figures.answering(self._fresh(), glance(self._page))

    def _fresh(self) -> dict[str, Status]:
        now, heard = time.monotonic(), self._client.heard
        return {name: said for name, said in self._client.statuses.items() if now - heard[name] < FRESH}
