# SPDX-License-Identifier: Apache-2.0
"""A second operating point on the same motion of the hand: device and simulation in lock-step, a process of its own.

The viewer sends lines of JSON: first the system, then where the hand's target is at which time, or "again" for the
start of the scene; it gets a line of where everything is for each. The process runs niced: it may fall behind, and the
page then says so; nothing waits for it. What it writes to its standard error is kept in a file: the last line says why
it ended.
"""

import asyncio
import contextlib
import itertools
import json
import math
import os
import sys
import tempfile
from asyncio.subprocess import PIPE

from haptic_device.device import operator_hand
from haptic_device.os_errors import in_words
from haptic_device.process import ending_with_us, own_environment, running_module

LONGEST = 0.1  # s of motion computed at once; a longer silence is left out
MOST_BEHIND = 2  # answers outstanding, beyond which motion is left out: it shows the newest place, not an old way
LATE = 0.2  # s behind that are worth a sentence
NICE = 10
LINE = 1 << 20  # bytes of an answer at most


class ShadowSimulation:
    """The viewer's end, of a running event loop. `latest` is the newest state, or None before it is ready or when it
    has ended; `problem` a sentence if it has ended by itself; `system` what it was made of (ShadowSystem); `awaited`
    how many answers are outstanding; `pid` the process, None before it runs."""

    def __init__(self, system: dict):
        self.system, self.latest, self.problem, self.pid = system, None, "", None
        self.awaited, self._now, self._then, self._input = 0, 0.0, 0.0, None
        self._running = asyncio.create_task(self._run())

    @property
    def note(self) -> str:
        """One sentence if it does not show what it should: it has ended, or is behind."""
        behind = self._now - self._then
        if self.problem or behind < LATE or self.latest is None:
            return self.problem
        return f"the second operating point is {behind:.1f} s behind: its process gets too little of the processor"

    def move(self, now: float, target) -> None:
        """The hand's target [m, m, rad] in device units at this time [s]; left out while it is far behind."""
        self._then = self._then or now
        self._now = now
        if self.awaited < MOST_BEHIND:
            self._ask({"time": now, "target": list(target)})

    def start_again(self) -> None:
        """Everything back to the start of the scene."""
        self._ask({"again": True})

    async def close(self) -> None:
        """Ends the process."""
        self._running.cancel()
        await asyncio.wait([self._running])

    def _ask(self, content):
        if self._input is not None:
            self.awaited += 1
            self._input.write(json.dumps(content).encode() + b"\n")

    async def _run(self):
        try:
            with tempfile.TemporaryFile("w+", errors="replace") as errors:
                await self._run_process(errors)
        except (ValueError, OSError) as error:
            self.problem = self.problem or f"the second operating point cannot go on: {error}"
        finally:
            self.latest = self._input = None

    async def _run_process(self, errors):
        command = ending_with_us(running_module("haptic_sim.viewer.shadow_simulation"))
        process = await asyncio.create_subprocess_exec(
            *command, stdin=PIPE, stdout=PIPE, stderr=errors, env=own_environment(), limit=LINE
        )
        self.pid, self._input = process.pid, process.stdin
        try:
            self._ask(self.system)
            async for line in process.stdout:
                with contextlib.suppress(json.JSONDecodeError):  # what a library printed
                    self._take(json.loads(line))
            self.problem = self.problem or _end(await process.wait(), errors)
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.communicate()

    def _take(self, answer):
        if not isinstance(answer, dict):  # what a library printed
            return
        if "refusal" in answer:
            self.problem = answer["refusal"]
            return
        self._then = answer.pop("time") or self._then
        self.latest, self.awaited = answer, self.awaited - 1


def _end(code, errors):
    """Why it has ended, in a sentence."""
    errors.seek(0)
    said = errors.read().strip().splitlines()[-1:]
    why = said[0][:200] if said else f"signal {-code}" if code < 0 else f"exit code {code}"
    return f"the second operating point has ended by itself ({why})"


class ShadowSystem:
    """The other end: a lock-step system whose hand goes where it is told.

    system: scene (as JSON), device (name or file), driver, loopback and simulation (values of their parameters), method
    (as it runs), start (x, y, theta of handle and hand, in the world), delay (round trip of the exchange [s]).
    """

    def __init__(self, system: dict):
        from haptic_device.description import load_device
        from haptic_sim.exchange.simulation import Simulation
        from haptic_sim.reduction import reduce_scene
        from haptic_sim.replay.lockstep import Lockstep, Network
        from haptic_sim.scene.language import parse

        values = system["simulation"] | {"method": system["method"]}
        reduced = reduce_scene(parse(system["scene"], "scene"), values["method"])
        self.simulation = Simulation.by_parameters(reduced, values)
        loopback = system["loopback"] | {"motion.name": "follow", "motion.start": system["start"]}
        driver, network = system["driver"], Network(delay=system["delay"])
        self._lockstep = Lockstep(load_device(system["device"]), driver, loopback, self.simulation, network)
        self._motion = self._lockstep.motion
        self._motion["kind"], self._motion["count"], self._motion["started"] = operator_hand.PATH, 2, 1
        self._motion["grip"][0, :2] = 1.0
        self._now, self._place = None, None
        self._motion["points"][0, :2] = self._motion["points"][0, 0]
        self._row = self._lockstep.run(1e-3)[-1]  # compiles, if nobody has before

    def move(self, now: float, target) -> dict:
        """Goes on to this time, the hand on a straight line to the target in device units; returns where all is."""
        if self._now is not None:
            self._run(min(LONGEST, max(0.0, now - self._now)), target)
        self._now, self._place = now, target
        return self.state()

    def _run(self, seconds, target):
        lockstep, motion = self._lockstep, self._motion
        if seconds * 1e9 < lockstep.period:
            return
        begin = (lockstep.ticks * lockstep.period) * 1e-9
        motion["times"][0, :2] = begin, begin + seconds
        motion["points"][0, 0, : len(target)], motion["points"][0, 1, : len(target)] = self._place, target
        self._row = lockstep.run(seconds)[-1]

    def state(self) -> dict:
        """Time of the last motion [s], None before; and what places() has."""
        return {"time": self._now, **places(self._row, self.simulation)}


def places(row, simulation) -> dict:
    """Handle, tool and bodies in the world [m, m, rad], force of the motor on the handle [N, N, N m], after this tick.
    Raises ValueError if one is no number."""
    method = simulation.method
    bodies = [method.pose(body.name) for body in simulation.scene.bodies]
    force = row.force_on_handle.tolist()
    if not all(map(math.isfinite, (*row.position, *force, *method.position, *itertools.chain(*bodies)))):
        raise ValueError("the second operating point has blown up: where its bodies are is no number any more")
    return {"handle": row.position.tolist(), "force": force, "tool": list(method.position), "bodies": bodies}


def main() -> int:
    """Answers each line of standard input until it ends."""
    os.nice(NICE)
    shadow = system = None
    for line in sys.stdin:
        content = json.loads(line)
        try:
            if "scene" in content or "again" in content:
                system = system or content
                shadow = ShadowSystem(system)
            state = shadow.move(content["time"], content["target"]) if "time" in content else shadow.state()
            print(json.dumps(state, allow_nan=False), flush=True)
        except (ValueError, OSError) as refusal:
            print(json.dumps({"refusal": in_words(refusal)}), flush=True)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
