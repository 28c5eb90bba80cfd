# SPDX-License-Identifier: Apache-2.0
"""Recorded ticks computed again to the bit, and a recorded hand on the same and on other gains, in lock-step."""

import numpy as np
import pytest
from bag_of_a_run import swing, write_run
from in_process import haptic
from lockstep_systems import device, values

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.control import controller_config, gain_check
from haptic_device.realtime import tick_replay
from haptic_device.recording import load
from haptic_display.cli import tables
from haptic_display.run.report import page
from haptic_display.run.report.quantities import sections
from haptic_display.run.report.reading import read_run
from haptic_sim.lockstep import rerun, trace_verification
from haptic_sim.lockstep.lockstep import PERFECT, Lockstep
from haptic_sim.lockstep.lockstep_bag import BLOCK as BLOCK_OF_BAG
from haptic_sim.lockstep.recorded_operator import PlayedDevice
from haptic_sim.lockstep.trace_verification import verdict_on
from haptic_sim.node.parameters import NODES
from haptic_sim.scene.language import load as load_scene

TICKS, PLAYED = 8_000, 10_000  # of every law; of the bag
COUPLED = {"coupling__stiffness": 800.0, "coupling__damping": 1.0, "engage__time": 0.1}


def busy(ticks):
    """Rows of a system in which every law has something to do, and its settings."""
    walls = {"wall__normals": (0.0, 1.0), "wall__offsets": (-0.01,), "wall__stiffness": (2000.0,)}
    laws = {"cancellation__ratio": 0.3, "velocity__estimator": "adaptive_window", "velocity__lag": 0.0005}
    driver = values("haptic_driver", **COUPLED, **walls, **laws, wall__damping=(1.0,))
    circle = {"motion__name": "circle", "motion__turns": ticks / 6000.0}
    hand = values("haptic_loopback", motion__duration=ticks / 4000.0, **circle)
    system = Lockstep(device(damping=8.0, counts=1e5, axes=3), driver, hand, None)
    start = tick_replay.snapshot_of(-1, system.settings[0], system.memory[0])
    return system, start, system.run(ticks / 4000.0)


@pytest.fixture(autouse=True)
def one_figure(monkeypatch):
    """Pages of which the tests look at the words."""
    monkeypatch.setattr(page, "FIGURES", page.FIGURES[:1])


@pytest.fixture(scope="module")
def recorded():
    _, start, rows = busy(TICKS)
    return rows.view(np.ndarray), start


def test_recorded_ticks_of_every_law_are_computed_again_to_the_bit(recorded, monkeypatch):
    monkeypatch.setattr(trace_verification, "BLOCK", 3_000)  # computed at a time
    rows, start = recorded
    assert np.abs(rows["force_on_handle"]).max() > 1.0 and rows["force_walls"].any()
    found = verdict_on(rows, start)
    assert (found.same, found.different, found.skipped) == (TICKS, 0, 0)


def test_one_bit_changed_in_an_output_or_one_count_in_the_input_is_found_and_its_columns_are_named(recorded):
    rows, start = recorded[0][:5000], recorded[1]
    for column in ("force_on_handle", "energy_given", "exchange_fade"):
        changed = rows.copy()
        changed[column].reshape(len(rows), -1).view(np.int64)[3000, 0] ^= 1
        assert verdict_on(changed, start) == (4999, 0, 1, 3000, (column,))
    changed = rows.copy()
    changed["counts"][3000, 0] += 1
    found = verdict_on(changed, start)  # every tick that remembers it
    assert found.different > 1 and found.first == 3000 and {"position", "velocity"} <= set(found.columns)
    old = rows[[name for name in rows.dtype.names if name != "withheld"]]  # as traces were before it
    assert verdict_on(old.copy(), start) == (5000, 0, 0, None, ())


def test_after_a_gap_it_goes_on_from_the_next_snapshot_and_changed_settings_count_from_their_version_on():
    system, start, rows = busy(2000)
    later = tick_replay.snapshot_of(system.ticks - 1, system.settings[0], system.memory[0])
    more = system.run(0.25)
    found = verdict_on(np.concatenate([rows[:500], rows[600:], more]), np.concatenate([start, later]))
    assert (found.same, found.skipped, found.different) == (500 + len(more), len(rows) - 600, 0)
    system.settings["version"], system.settings["coupling"]["stiffness"] = 1, 300.0
    changed = tick_replay.snapshot_of(system.ticks + 100, system.settings[0], system.memory[0])
    before, trace = len(rows) + len(more), np.concatenate([rows, more, system.run(0.5)])
    assert verdict_on(trace, np.concatenate([start, changed])).same == len(trace)
    assert verdict_on(trace, start).skipped == len(trace) - before


def test_snapshots_with_columns_that_are_no_more_are_computed_as_those_without(recorded):
    rows, start = recorded[0][:100], recorded[1]
    more = np.zeros(1, [("memory.gone", "f8", (3,)), *start.dtype.descr])
    for name in start.dtype.names:
        more[name] = start[name]
    assert verdict_on(rows, more).same == 100


SINCE_LINKAGES = (  # beginnings of columns of snapshots
    *(f"settings.{name}" for name in ("linkage_", "port_joints", "port_lever", "most_force", "step")),
    *(f"memory.{name}" for name in ("joint", "jacobian", "account_place", "account_jacobian")),
)


def test_a_bag_from_before_there_were_joints_is_computed_again_to_the_bit(recorded):
    rows, start = recorded[0][:500], recorded[1]
    before = [name for name in start.dtype.names if not name.startswith(SINCE_LINKAGES)]
    assert len(start.dtype.names) - len(before) == 8 + 9  # eight of the linkage, two that begin with joint
    of_then = rows[[name for name in rows.dtype.names if name not in ("joint", "torque")]]
    found = verdict_on(of_then, start[before])
    assert (found.same, found.different, found.skipped) == (500, 0, 0)


def test_a_linkage_played_as_device_has_its_handle_where_it_was_and_its_ticks_are_the_same_again():
    described, times, angle = load_device("serial_2r"), np.arange(2000) * 250_000.0, np.linspace(0.0, 6.0, 2000)
    way = np.stack([0.02 * np.sin(angle), 0.075 + 0.02 * np.cos(angle), 0.0 * angle], axis=1)
    wall = {"wall__offsets": (0.08,), "wall__normals": (0.0, 1.0), "wall__stiffness": (20.0,), "wall__damping": (0.0,)}
    driver = values("haptic_driver", coupling__stiffness=10.0, coupling__damping=0.0, engage__time=0.05, **wall)
    hand = values("haptic_loopback", motion__start=tuple(way[0]))
    system = Lockstep(described, driver, hand, None, hand=PlayedDevice(times, way))
    start = tick_replay.snapshot_of(-1, system.settings[0], system.memory[0])
    rows = system.run(0.499).view(np.ndarray)
    for axis, felt in enumerate(described.axes):  # which has the way of a count at the worst pose
        there = np.interp(rows["deadline"], times, way[:, axis])
        assert np.abs(rows["position"][:, axis] - there).max() < 1.0 / felt.counts_per_unit
    assert np.abs(rows["torque"]).max() > 1e-3 and not rows["fault"].any()
    assert verdict_on(rows, start).same == len(rows)


def test_a_trace_of_another_version_or_without_snapshots_is_refused_in_a_sentence(recorded):
    rows, start = recorded[0][:10], recorded[1]
    without = rows[[name for name in rows.dtype.names if name != "margin"]]
    of_less = start[[name for name in start.dtype.names if name != "settings.stiffness"]]
    of_other = start.copy()
    of_other["settings.exchange_method"] = 1.0
    for trace, snapshots, said in (
        (without, start, "another version of the servo; it differs in margin"),
        (rows, start[:0], "no snapshot"),
        (rows, of_less, "snapshots lack settings.stiffness"),
        (rows, of_other, "recorded with exchange method 1, which this version lacks"),
    ):
        with pytest.raises(ValueError, match=said):
            verdict_on(trace, snapshots)


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A lock-step run of the wall scene as a bag: the hand presses the tool against a wall."""
    scene = load_scene("wall")
    motion = {f"motion.{name}": value for name, value in scene.motion.items()} | {"motion.duration": 4.0}
    shipped = values("haptic_loopback") | motion
    driver = values("haptic_driver", **COUPLED)
    simulation = defaults(NODES["haptic_simulation"]) | {"scene": "wall"}
    point = rerun.Point(device(damping=4.0, axes=3), scene, driver, shipped, simulation)
    folder = tmp_path_factory.mktemp("replays") / "recorded"
    rerun.replay(rerun.Hand(Script(), PLAYED / 4000.0), point, PERFECT, folder)
    return folder


class Script:
    """The operator's own script in place of a recorded hand."""

    def begin(self, system):
        """It begins by itself."""

    def run(self, system, rows, start):
        system.script_ticks(rows, start)


def again(bag, folder, as_device, **changes):
    recording = rerun.recorded(bag)
    given = {"haptic_driver": {name.replace("__", "."): value for name, value in changes.items()}}
    point = rerun.recorded_point(recording, given)
    rerun.replay(rerun.hand_of(recording, as_device), point, PERFECT, folder)
    return read_run(folder)


def test_a_replayed_bag_is_whole_like_a_live_one_and_its_ticks_are_the_same_again(bag):
    recording = load(bag)
    assert recording.notes == () and recording.trace_rows_missing == 0
    assert not any(skipped.lost or skipped.back for skipped in recording.skipped.values())
    assert verdict_on(recording.trace, recording.clouds["snapshot"]).same == len(recording.trace) == PLAYED
    assert {"scene/wall.yaml", "device/desktop.yaml", "parameters/haptic_driver.yaml"} <= set(recording.attachments)


def test_the_same_hand_on_the_same_gains_ends_where_it_was_and_at_a_rate_of_another_step_moves_to_its_end(
    bag, tmp_path
):
    before, after = read_run(bag), again(bag, tmp_path / "again", False)
    count = min(len(before.rows), len(after.rows))
    assert np.abs(before.rows["position"][:count] - after.rows["position"][:count]).max() < 2e-4
    assert len(before.contacts) == len(after.contacts)
    slow = again(bag, tmp_path / "slow", False, servo__rate=700.0, coupling__stiffness=200.0)
    assert len(slow.recording.trace) == pytest.approx(before.seconds[-1] * 700.0, abs=1.0)


def test_as_device_the_handle_is_where_it_was_to_the_count(bag, tmp_path):
    before, after = read_run(bag), again(bag, tmp_path / "device", True, coupling__stiffness=400.0)
    began = before.rows["deadline"][0]
    there = {deadline - began: position for deadline, position in before.rows[["deadline", "position"]].tolist()}
    both = [row for row in after.rows if row["deadline"] in there]
    assert len(both) > 0.9 * PLAYED
    assert max(np.abs(row["position"] - there[row["deadline"]]).max() for row in both) == 0.0


def stiff(tmp_path, policy):
    """An operating point beyond the damping of the device of the bag."""
    gains = "coupling: {stiffness: 90000.0, damping: 0.0}"
    point = tmp_path / "stiff.yaml"
    point.write_text(f"/**/haptic_driver:\n  ros__parameters:\n    {gains}\n    passivity: {{policy: '{policy}'}}\n")
    return point


def test_gains_that_the_driver_refuses_are_refused_in_its_sentence_and_nothing_is_written(bag, tmp_path):
    out = tmp_path / "out"
    done = haptic("replay", bag, "--params", stiff(tmp_path, "enforce"), "--out", out)
    wished = values("haptic_driver", **COUPLED | {"coupling__stiffness": 90000.0, "coupling__damping": 0.0})
    sentence = gain_check.refusal(controller_config.settings_from(device(damping=4.0, axes=3), wished)[0])
    assert (done.returncode, done.stdout, done.stderr) == (1, "", f"haptic: {sentence}\n")
    assert "coupling.stiffness 90000 N/m" in sentence and not out.exists()


@pytest.mark.parametrize("policy", ["", "warn"], ids=["replay", "compare"])
def test_an_interrupted_replay_keeps_every_tick_that_was_played_and_says_where(bag, tmp_path, monkeypatch, policy):
    run, played, out = Lockstep.run, 0, tmp_path / "out"

    def interrupted(system, seconds):
        nonlocal played
        if played >= 2100:
            raise KeyboardInterrupt
        rows = run(system, seconds)
        played += len(rows)
        return rows

    monkeypatch.setattr(Lockstep, "run", interrupted)
    done = haptic(*["compare", bag, stiff(tmp_path, policy)] if policy else ["replay", bag], "--out", out)
    kept = out / "1-stiff" if policy else out
    assert (done.returncode, done.stderr) == (130, f"broken off: what was played is in {kept}\n")
    assert played % BLOCK_OF_BAG and len(load(kept).trace) == played


def test_compare_tells_of_each_operating_point_the_figures_of_the_report_and_the_stiffness_that_was_set(bag, tmp_path):
    points, out = {"soft": 400.0, "hard": 1200.0}, tmp_path / "out"
    for name, stiffness in points.items():
        content = f"/**/haptic_driver:\n  ros__parameters:\n    coupling: {{stiffness: {stiffness}}}\n"
        (tmp_path / f"{name}.yaml").write_text(content)
    done = haptic("compare", bag, *(tmp_path / f"{name}.yaml" for name in points), "--out", out)
    assert done.returncode == 0 and "1-soft" in done.stdout and "2-hard" in done.stdout
    assert done.stderr.endswith(f"next: open {out / 'report/report.html'}\n") and (out / "report/report.html").exists()
    for run, stiffness in ((read_run(out / "1-soft"), 400.0), (read_run(out / "2-hard"), 1200.0)):
        found = run.impedances["contact", "x"]
        assert found.explained > 0.99 and found.stiffness.value == pytest.approx(stiffness, rel=0.02)
        told, shown = tables.compared(run), sections(run)
        x, y = (part.removesuffix(" N s/m") for part in shown["Energy"]["least margin x, y, θ"].split(", ")[:2])
        assert told["least margin [N s/m]"] == min(x, y, key=float) and float(x) > 0.0
        assert f"{told['stiffness [N/m]']} N/m" in shown["Impedance added by the display"].values()


def test_a_bag_without_motion_is_refused_in_a_sentence(tmp_path):
    rows = swing(400)
    folder = write_run(tmp_path / "run", rows)
    with pytest.raises(ValueError, match="replay it --as device"):
        rerun.hand_of(load(folder, only={"trace": rerun.PLAYED}), False)
    rows["engage"] = 0.0
    with pytest.raises(ValueError, match="no motion to replay"):
        rerun.hand_of(rerun.recorded(write_run(tmp_path / "idle", rows)), False)
