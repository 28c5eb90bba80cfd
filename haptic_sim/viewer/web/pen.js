// SPDX-License-Identifier: Apache-2.0
// Strokes on a canvas, and points of frames in the plane.

export function line(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}

// A point of a frame at a pose, as a point of the plane.
export function placed([px, py], [x, y, theta]) {
  const [c, s] = [Math.cos(theta), Math.sin(theta)];
  return [x + c * px - s * py, y + s * px + c * py];
}

export function path(context, corners) {
  context.beginPath();
  corners.forEach((corner, i) => (i ? context.lineTo(...corner) : context.moveTo(...corner)));
  context.closePath();
}

// A spring, as wide and as steep however long it is; where it has no length to speak of, and without a width, a line.
export function zigzag(context, [x1, y1], [x2, y2], width) {
  const length = Math.hypot(x2 - x1, y2 - y1);
  const [ux, uy] = [(x2 - x1) / length, (y2 - y1) / length];
  const teeth = width > 0 && length > 1 ? Math.min(200, Math.max(6, Math.round(length / width))) : 0;
  context.beginPath();
  context.moveTo(x1, y1);
  for (let i = 1; i < teeth; i += 1) {
    const [along, side] = [(length * i) / teeth, i % 2 ? width : -width];
    context.lineTo(x1 + ux * along - uy * side, y1 + uy * along + ux * side);
  }
  context.lineTo(x2, y2);
  context.stroke();
}

// A spring about a point.
export function spiral(context, [x, y], width) {
  context.beginPath();
  for (let turn = 0; turn < 5 * Math.PI; turn += 0.3) {
    const r = (width * turn) / (5 * Math.PI);
    context.lineTo(x + r * Math.cos(turn), y - r * Math.sin(turn));
  }
  context.stroke();
}

// An outline of a solid at a pose, as a path; of a disc with the radius that shows how it is turned.
export function trace(context, plane, [vertices, radius], pose) {
  const corners = vertices.map((corner) => plane.toPixels(placed(corner, pose)));
  path(context, corners);
  if (!(radius > 0)) return;
  context.arc(...corners[0], radius * plane.scale, -pose[2], 2 * Math.PI - pose[2]);
}

export function outline(context, plane, outlines, pose) {
  for (const one of outlines) {
    trace(context, plane, one, pose);
    context.stroke();
  }
}

// From a tool's grip, where the coupling holds it, to its nearest shape, if it does not lie in one.
export function grip(context, plane, outlines, pose) {
  const end = nearest(outlines);
  if (end) line(context, ...plane.toPixels(pose), ...plane.toPixels(placed(end, pose)));
}

// The point of convex outlines that is nearest to their frame's origin; null if it lies in one of them, or there is none.
function nearest(outlines) {
  let [least, found] = [Infinity, null];
  for (const [vertices, radius] of outlines) {
    let within = true;
    vertices.forEach(([x, y], i) => {
      const [nx, ny] = vertices[(i + 1) % vertices.length];
      const [dx, dy] = [nx - x, ny - y];
      const along = Math.min(1, Math.max(0, -(x * dx + y * dy) / (dx * dx + dy * dy || 1)));
      const point = [x + along * dx, y + along * dy];
      const way = Math.hypot(...point);
      within &&= radius > 0 ? way <= radius : dx * -y - dy * -x >= 0;
      if (way - radius >= least) return;
      least = way - radius;
      found = point.map((value) => value * (1 - radius / (way || 1)));
    });
    if (within) return null;
  }
  return found;
}
