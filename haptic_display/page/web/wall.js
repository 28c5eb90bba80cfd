// SPDX-License-Identifier: Apache-2.0
// A wall of the servo as numbers: normal [nx, ny] towards the free side, offset along it [m], stiffness [N/m], damping.

const BELOW = 0.01; // m between the handle and a wall that is added
const ASIDE = 0.03; // m
const SOFT = 1000; // N/m of a wall that is added, at most

// The walls of the driver's values; none where the four lists do not fit.
export function wallsOf(values) {
  const [normals, offsets, stiffness, damping] = ["normals", "offsets", "stiffness", "damping"].map((name) => values[`wall.${name}`] ?? []);
  if (normals.length !== 2 * offsets.length) return [];
  return offsets.map((offset, i) => ({ normal: normals.slice(2 * i, 2 * i + 2), offset, stiffness: stiffness[i], damping: damping[i] }));
}

// The driver's values of these walls: they are set together, since they refuse each other one by one.
export function valuesOf(walls) {
  return {
    "wall.normals": walls.flatMap(({ normal }) => normal.map(short)),
    "wall.offsets": walls.map(({ offset }) => short(offset)),
    "wall.stiffness": walls.map(({ stiffness }) => stiffness),
    "wall.damping": walls.map(({ damping }) => damping),
  };
}

// A wall near the handle, which is outside of it; as stiff as leaves half of what is passive.
export function besides(handle, axes, passive) {
  const normal = axes < 2 ? [1, 0] : [0, 1];
  const most = passive ? Number((0.5 * passive[1]).toPrecision(2)) : SOFT;
  return { normal, offset: along(normal, handle) - BELOW, stiffness: Math.min(SOFT, most), damping: 0 };
}

// The wall where it is wanted, or at the handle: the servo, too, lets no wall that is moved push the hand.
export function yielding(wanted, before, handle) {
  if (!handle) return wanted;
  const deepest = Math.max(0, depth(before, handle));
  return depth(wanted, handle) <= deepest ? wanted : { ...wanted, offset: along(wanted.normal, handle) + deepest };
}

// Turned about a place to this angle of its normal [degrees].
export function turned(wall, degrees, place) {
  const normal = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  return { ...wall, normal, offset: along(normal, place) };
}

export function angleOf({ normal: [x, y] }) {
  return Number(((Math.atan2(y, x) * 180) / Math.PI).toFixed(1));
}

// The place on the wall that is nearest to another.
export function onto({ normal, offset }, place) {
  const step = offset - along(normal, place);
  return [place[0] + step * normal[0], place[1] + step * normal[1]];
}

// Where the dots of a wall stand at first: not over the handle.
export function aside({ normal: [nx, ny] }, [x, y]) {
  return [x + ASIDE * ny, y - ASIDE * nx];
}

export function along([nx, ny], [x, y]) {
  return nx * x + ny * y;
}

function depth({ normal, offset }, place) {
  return offset - along(normal, place);
}

function short(number) {
  return Number(number.toPrecision(9));
}
