# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` alive, once: the job is done, every figure is reported, and its bag replays to the bit."""

import json
import re
from pathlib import Path

from live_demo import BUSY, ROOT, demos

from haptic_device.control import withheld
from haptic_device.recording import load
from haptic_sim.lockstep.trace_verification import verdict_on
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene import language


def flat(found: dict, prefix: str = "") -> set[str]:
    keys = set()
    for key, value in found.items():
        keys |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key}
    return keys


def documented() -> set[str]:
    text = (ROOT / "docs/reference/cli.md").read_text().split("| key |")[1].split("\n\n")[0]
    rows = [re.findall(r"`([\w.]+)`", line.split("|")[1]) for line in text.splitlines()[2:]]
    return {key if key[0] != "." else first.rpartition(".")[0] + key for first, *more in rows for key in (first, *more)}


def test_the_peg_goes_into_the_hole_every_figure_is_reported_and_no_node_compiles(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DEBUG_CACHE", "1")  # numba says what it loads, and what it had to compile
    with demos(tmp_path) as demo:
        run = demo("--json", *BUSY)
        assert run.ended() == 0, run.progress + run.said
    logs = {log.stem: log.read_text() for log in (run.out / "log").glob("haptic_*.log")}
    assert all("data loaded from" in logs[name] for name in ("haptic_driver", "haptic_loopback", "haptic_simulation"))
    assert not any("data saved to" in log for log in logs.values())
    found = json.loads(run.said.splitlines()[-1])
    assert found["done"] and found["faults"] == [] and found["result"]["insertion_fraction"] >= 0.95
    # by cause, and what is withheld on a busy machine is not known
    causes = {f"withheld_s.{cause.name}" for cause in withheld.TABLE}
    assert flat(found) - causes == documented() - {"withheld_s.CAUSE"} and isinstance(found["withheld_s"], dict)
    reduced = reduce_scene(language.load("peg_in_hole"))
    assert [found["simulation"][name] for name in ("method", "why")] == ["impulse", reduced.reasons[0]]
    assert found["exchange"]["sent"] >= found["exchange"]["answered"] > 0
    assert found["energy_j"]["given_to_operator_end"] < 0.0  # by the truth: who pushed the peg has worked
    assert found["contact"]["max_force_n"] > 0.0
    assert Path(found["report"]).read_bytes().startswith(b"\x89PNG")
    recording = load(Path(found["bag"]))
    assert {"trial.yaml", "made.yaml", "device/desktop.yaml", "scene/peg_in_hole.yaml"} <= set(recording.attachments)
    rise = {"encoder", "motor", "handle", "tool", "wrench", "pose", "joint_states", "operator/state", "trace"}
    rise |= {"snapshot", "scene/state", "scene/contacts"}
    assert set(recording.orders) == {f"/haptic/{topic}" for topic in rise}
    assert all((order.back, order.same) == (0, 0) for order in recording.orders.values())
    every = verdict_on(recording.trace, recording.clouds["snapshot"])
    assert every.different == 0 and every.same > 0 and every.same + every.skipped == len(recording.trace)
    later = verdict_on(recording.trace[100:], recording.clouds["snapshot"])
    assert later.different == 0 and later.same > 0  # from memory that was copied while the servo ran
