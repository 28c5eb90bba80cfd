#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation with a body of your own, a flap on a hinge: run it in place of that node, beside the others.

python3 own_bodies.py --ros-args -r __ns:=/haptic -p scene:=free_space -p method:=impulse
"""

import pymunk

from haptic_sim.node.simulation import main

HINGE, LENGTH, THICK = (-0.03, 0.05), 0.045, 0.002  # [m]; the circle that the hand is led on goes by below the hinge


def add_flap(world):
    """Called with each new world, also after a reset; what it adds stays as long as that world does. Units are SI."""
    space, mass = world.space, 0.02
    flap = pymunk.Body(mass, pymunk.moment_for_box(mass, (THICK, LENGTH)))
    flap.position = HINGE[0], HINGE[1] - 0.5 * LENGTH
    blade = pymunk.Poly.create_box(flap, (THICK, LENGTH))
    hinge = pymunk.PivotJoint(space.static_body, flap, HINGE)
    spring = pymunk.DampedRotarySpring(space.static_body, flap, 0.0, 0.05, 5e-4)
    space.add(flap, blade, hinge, spring)


if __name__ == "__main__":
    raise SystemExit(main(added=add_flap))
