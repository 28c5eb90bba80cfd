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

export function zigzag(context, [x1, y1], [x2, y2], width) {
  const length = Math.hypot(x2 - x1, y2 - y1);
  const [ux, uy] = length > 0 ? [(x2 - x1) / length, (y2 - y1) / length] : [0, 0];
  context.beginPath();
  context.moveTo(x1, y1);
  for (let i = 1; i < 12 && length > 2 * width; i += 1) {
    const [along, side] = [(length * i) / 12, i % 2 ? width : -width];
    context.lineTo(x1 + ux * along - uy * side, y1 + uy * along + ux * side);
  }
  context.lineTo(x2, y2);
  context.stroke();
}

// The point of convex outlines that is nearest to their frame's origin; null if it lies in one of them, or there is none.
export function nearest(outlines) {
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
