# SPDX-License-Identifier: Apache-2.0
"""A second operating point on the same motion of the hand: device and simulation in lock-step, a process of its own.

The viewer sends lines of JSON, first the system, then where the hand's target is at which time; it gets a line of where
everything is for each. The process runs niced: it may fall behind, and then says so; nothing waits for it.
"""

import contextlib
import json
import os
import subprocess
import sys
import threading

from haptic_device.runtime.process import die_with_parent

LONGEST = 0.1  # s of motion computed at once; a longer silence is left out
NICE = 10


class Second:
    """The viewer's end. `latest` is the newest state, or None before it is ready; `problem` a sentence if it has ended
    by itself; `system` what it was made of (Ghost)."""

    def __init__(self, system: dict):
        own = os.getpid()
        self.system, self.latest, self.problem, self._asked, self._answered = system, None, "", 0, -1
        self._process = subprocess.Popen(
            [sys.executable, "-m", "haptic_sim.viewer.second"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, preexec_fn=lambda: die_with_parent(own),
        )  # fmt: skip
        threading.Thread(target=self._listen, name="second", daemon=True).start()
        self._say(system)

    def move(self, now: float, target) -> None:
        """The hand's target [m, m, rad] in device units at this time [s]; left out while it is a second behind."""
        if not self.problem and self._asked - self._answered < 60:
            self._asked += 1
            self._say({"time": now, "target": list(target)})

    def start_again(self) -> None:
        """Everything back to the start of the scene."""
        self._asked += 1
        self._say(self.system)

    def close(self) -> None:
        """Ends the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._process.stderr):
            with contextlib.suppress(OSError):  # what it had not read yet
                stream.close()

    def _say(self, content):
        try:
            self._process.stdin.write(json.dumps(content) + "\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            self.problem = self.problem or "the second operating point has ended"

    def _listen(self):
        try:
            for line in self._process.stdout:
                answer = json.loads(line)
                if "refusal" in answer:
                    self.problem = answer["refusal"]
                else:
                    self.latest, self._answered = answer, self._answered + 1
            self.problem = self.problem or "the second operating point has ended"
        except ValueError:
            return  # closed


class Ghost:
    """The other end: a lock-step system whose hand goes where it is told.

    system: scene (as JSON), device (name or file), driver and loopback (values of their parameters), method, start
    (x, y, theta of handle and hand, in the world), delay (round trip of the exchange [s]).
    """

    def __init__(self, system: dict):
        from haptic_device.device import load_device
        from haptic_device.law import operator
        from haptic_sim.lockstep import Lockstep, Network
        from haptic_sim.node.declared import AUTO
        from haptic_sim.scene import parse
        from haptic_sim.simulation import Simulation
        from haptic_sim.tool_port import port_of

        method = None if system["method"] == AUTO else system["method"]
        port = port_of(system["driver"]["exchange.method"])
        simulation = Simulation(parse(system["scene"], "scene"), method=method, port=port)
        loopback = system["loopback"] | {"motion.name": "follow", "motion.start": system["start"]}
        driver, network = system["driver"], Network(delay=system["delay"])
        self._lockstep = Lockstep(load_device(system["device"]), driver, loopback, simulation, network)
        self._motion = self._lockstep.motion
        self._motion["kind"], self._motion["count"], self._motion["started"] = operator.PATH, 2, 1
        self._motion["grip"][0, :2] = 1.0
        self._simulation, self._now, self._place = simulation, None, None
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
        """Handle, tool and bodies in the world [m, m, rad], force of the motor on the handle [N, N, N m]."""
        method, row = self._simulation.method, self._row
        bodies = [method.pose(body.name) for body in self._simulation.scene.bodies]
        force = row.force_on_handle.tolist()
        return {"handle": row.position.tolist(), "force": force, "tool": list(method.position), "bodies": bodies}


def main() -> int:
    """Answers each line of standard input until it ends."""
    os.nice(NICE)
    ghost = None
    for line in sys.stdin:
        content = json.loads(line)
        try:
            if "scene" in content:
                ghost = Ghost(content)
            state = ghost.move(content["time"], content["target"]) if "time" in content else ghost.state()
            print(json.dumps(state), flush=True)
        except (ValueError, OSError) as refusal:
            print(json.dumps({"refusal": str(refusal)}), flush=True)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
