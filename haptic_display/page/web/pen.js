// SPDX-License-Identifier: Apache-2.0
// Strokes on a canvas, and points of frames in the plane.

export function line(context, x1, y1, x2, y2) {
  stroke(context, [[x1, y1], [x2, y2]]);
}

export function stroke(context, points) {
  trail(context, points);
  context.stroke();
}

function trail(context, points) {
  context.beginPath();
  points.forEach((point, i) => (i ? context.lineTo(...point) : context.moveTo(...point)));
}

// A point of a frame at a pose, as a point of the plane.
export function placed([px, py], [x, y, theta]) {
  const [c, s] = [Math.cos(theta), Math.sin(theta)];
  return [x + c * px - s * py, y + s * px + c * py];
}

export function circle(context, [x, y], r) {
  context.beginPath();
  context.arc(x, y, r, 0, 2 * Math.PI);
}

export function path(context, corners) {
  trail(context, corners);
  context.closePath();
}

// A spring, as wide and as steep however long it is; where it has no length to speak of, and without a width, a line.
export function zigzag(context, [x1, y1], [x2, y2], width) {
  const length = Math.hypot(x2 - x1, y2 - y1);
  const [ux, uy] = [(x2 - x1) / length, (y2 - y1) / length];
  const teeth = width > 0 && length > 1 ? Math.min(200, Math.max(6, Math.round(length / width))) : 0;
  const points = [[x1, y1]];
  for (let i = 1; i < teeth; i += 1) {
    const [along, side] = [(length * i) / teeth, i % 2 ? width : -width];
    points.push([x1 + ux * along - uy * side, y1 + uy * along + ux * side]);
  }
  stroke(context, [...points, [x2, y2]]);
}

// A spring about a point.
export function spiral(context, [x, y], width) {
  stroke(context, Array.from({ length: 53 }, (_, i) => {
    const [turn, r] = [0.3 * i, (width * 0.3 * i) / (5 * Math.PI)];
    return [x + r * Math.cos(turn), y - r * Math.sin(turn)];
  }));
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
