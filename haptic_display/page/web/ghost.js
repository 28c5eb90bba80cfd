// SPDX-License-Identifier: Apache-2.0
// The way that the scene suggests: a dashed line with an arrow, and the outline of the tool at its end.

import { grip, outline, path, stroke } from "./pen.js";

const HEAD = 11; // CSS pixels of the arrow

export function paintWay(context, view, { way, solids }) {
  const { plane, colours } = view;
  if (way.length < 2) return;
  const points = way.map((place) => plane.toPixels(place));
  view.pen(context, colours.soft, 2, [7, 6]);
  stroke(context, points);
  view.pen(context, colours.soft, 1.5, [4, 4]);
  outline(context, plane, solids[0].outlines, way.at(-1));
  grip(context, plane, solids[0].outlines, way.at(-1));
  context.fillStyle = colours.soft;
  paintHead(context, points, HEAD * plane.ratio);
}

// At the end, along the last stretch that is long enough to have a direction.
function paintHead(context, points, size) {
  const [x, y] = points.at(-1);
  const from = points.findLast(([px, py]) => Math.hypot(x - px, y - py) > 1);
  if (!from) return;
  const length = Math.hypot(x - from[0], y - from[1]);
  const [ux, uy] = [(x - from[0]) / length, (y - from[1]) / length];
  path(context, [[x, y], [x - size * (ux + 0.5 * uy), y - size * (uy - 0.5 * ux)], [x - size * (ux - 0.5 * uy), y - size * (uy + 0.5 * ux)]]);
  context.fill();
}
