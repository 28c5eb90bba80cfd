# SPDX-License-Identifier: Apache-2.0
"""Records of the simulated device: the plant as the description has it, and the hand on it."""

import math

import numpy as np

from haptic_device.config.drives import drives
from haptic_device.control import linkage
from haptic_device.device import operator_hand, plant

ROUNDED = 1e-12  # [m | rad] by which sums of a motion's numbers may miss the workspace


def hand_from(device, values):
    """Loopback's records of these parameter values: PLANT with its hand, PLANT_MEMORY at the start, MOTION.

    motion.* is in the world; the records are in the device's own units. Raises ValueError where the start lies outside
    the workspace.
    """
    body, memory, motion = plant_of(device), np.zeros(1, plant.PLANT_MEMORY), operator_hand.script(values)
    operator_hand.grip_by(body, values)
    scale = _scale(device)
    motion["points"] /= scale
    motion["radius"] /= device.scale[0]
    there = np.arange(3) < len(device.axes)
    start = np.where(there, values["motion.start"], 0.0) / scale
    for sentence in _outside(device, "motion.start", start):
        raise ValueError(sentence)
    memory["position"] = memory["target"] = start
    return body, memory, motion


def outside(device, values):
    """One sentence for each place of the motion that these values name, axis by axis, outside the device's workspace.

    A hand that aims there pulls the handle to where the driver latches a fault.
    """
    motion, name, scale = operator_hand.script(values)[0], values["motion.name"], _scale(device)
    radius, start = values["motion.radius"], np.array(values["motion.start"], float)
    began = list(_outside(device, "motion.start", start / scale))
    yield from began
    if name == "waypoints":
        places = {f"motion.waypoints {i}": motion["points"][i] for i in range(1, int(motion["count"]))}
    elif name == "circle" and not began:  # else all of it is elsewhere
        reach = (("topmost", 0.25, -1.0, 1.0), ("leftmost", 0.5, -2.0, 0.0), ("lowest", 0.75, -1.0, -1.0))
        places = {
            f"motion.radius, {where},": start + [x * radius, y * radius, 0.0]
            for where, turns, x, y in reach
            if values["motion.turns"] >= turns
        }
    else:
        places = {"motion.target": values["motion.target"]} if int(motion["count"]) > 2 else {}
    for where, place in places.items():
        yield from _outside(device, where, np.asarray(place) / scale)


def _outside(device, where, place):
    for axis, position in zip(device.axes, place, strict=False):
        low, high = axis.workspace
        unit = "rad" if axis.name == "theta" else "m"
        if not low - ROUNDED <= position <= high + ROUNDED:
            given = f"{where} {axis.name} is at {position:g} {unit} of the device"
            yield f"{given}; its workspace is {low:g} to {high:g} {unit}"


def _scale(device):
    """World units per device unit of x, y and theta."""
    return np.array([device.scale[0], device.scale[0], device.scale[1]])


def plant_of(device):
    """PLANT record of the loopback: the device as the description has it, no hand on it yet."""
    record = np.zeros(1, plant.PLANT)
    record["axes"] = len(device.axes)
    record["sensing_delay"], record["actuation_delay"] = device.sensing_delay * 1e9, device.actuation_delay * 1e9
    sensor = device.drag_sensor
    record["drag_bandwidth"] = 2.0 * math.pi * sensor.bandwidth
    record["drag_bias"], record["drag_noise"] = sensor.bias, sensor.noise
    record["mass"] = record["position_per_count"] = 1.0  # of the axes that are not there
    for i, axis in enumerate(device.axes):
        record["mass"][0, i], record["damping"][0, i] = axis.mass, axis.damping
        record["coulomb"][0, i], record["gravity"][0, i] = axis.coulomb, device.weight(i)
    for i, drive in enumerate(drives(device)):
        record["position_per_count"][0, i], record["zero"][0, i] = drive.step, -drive.zero
        record["force_per_motor"][0, i], record["force_limit"][0, i] = drive.force, drive.limit
    linkage.fill(record["linkage"][0], device.kinematics)
    for i, joint in enumerate(device.joints):
        record["handle_mass"], record["middle"][0, i] = device.handle.mass, sum(joint.limits) / 2.0
        record["mass"][0, i], record["damping"][0, i] = joint.inertia, joint.damping
        record["coulomb"][0, i] = joint.coulomb
    return record
