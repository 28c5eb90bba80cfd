# SPDX-License-Identifier: Apache-2.0
"""A live driver that a tool changes the gains of, and `haptic zwidth --live` on it."""

import contextlib
import subprocess
import sys
import time

from waiting import output, until

from haptic_sim.supervision.pair import running
from haptic_sim.supervision.tuning import Tuning

GAINS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "passivity.policy", "coupling.stiffness")
PATIENT = {"servo.rate": 1000.0, "fault.silence": 1.0, "fault.unattended": 0.0}
PAIR = PATIENT, {"motion.name": "follow", "motor_watchdog": 2.0}


@contextlib.contextmanager
def engaged_pair():
    """(tuning, domain, namespace) of driver and loopback with a hand that follows, engaged.

    No fault if the machine holds them up for a second."""
    with (
        running(None, None, *PAIR) as (domain, namespace, check),
        contextlib.closing(Tuning(domain, namespace)) as tuning,
    ):
        tuning.wait_engaged(check)
        yield tuning, domain, namespace


def zwidth_live(pair, start):
    """`haptic zwidth --live` as a person starts it, on the nodes of the pair."""
    words = ["zwidth", "--live", "--device", "desktop", "--domain", pair[1], "--namespace", pair[2]]
    command = [sys.executable, "-m", "haptic_sim.cli.main", *words]
    return start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def disturbed(pair, start, condition, act):
    """How `haptic zwidth --live` ends if act(process) comes once condition() holds."""
    process = zwidth_live(pair, start)

    def there():
        assert process.poll() is None, process.communicate()
        return condition()

    until(there, "the moment to disturb it", look=lambda: time.sleep(0.05))
    act(process)
    return sentence_of(process)


def sentence_of(process):
    """Exit code and the one line that the command says at its end."""
    said, complained = output(process)
    assert said == ""
    sentences = complained.strip().splitlines()
    assert len(sentences) == 1, complained
    return process.returncode, sentences[0]
