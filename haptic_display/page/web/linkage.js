// SPDX-License-Identifier: Apache-2.0
// The links of a device between its motors and the handle, as the viewer has them from its description, in the world.

import { circle, path, stroke } from "./pen.js";

const DOWN = [-1.05, 1.05]; // rad of a sector, from straight down

// From each motor over its elbow to the handle; of a sector its handle alone.
export function links({ arms, proximal, distal, sector }, [x, y]) {
  if (sector) return [[sector.pivot, [x, y]]];
  return arms.map(({ motor, side }) => {
    const [dx, dy] = [x - motor[0], y - motor[1]];
    const far = Math.hypot(dx, dy);
    const along = (proximal ** 2 + far ** 2 - distal ** 2) / (2 * far);
    const aside = side * Math.sqrt(Math.max(0, proximal ** 2 - along ** 2)); // 0: stretched, or a little beyond
    return [motor, [motor[0] + (along * dx - aside * dy) / far, motor[1] + (along * dy + aside * dx) / far], [x, y]];
  });
}

// Left, bottom, right, top of what stands still [m].
export function roomOf({ arms, sector, workspace: [[left, right], [bottom, top] = [0, 0]] }) {
  const places = sector ? [[sector.pivot[0], sector.pivot[1] - sector.radii[1]]] : arms.map(({ motor }) => motor);
  const [xs, ys] = [0, 1].map((axis) => places.map((place) => place[axis]));
  return [Math.min(left, ...xs), Math.min(bottom, ...ys), Math.max(right, ...xs), Math.max(top, ...ys)];
}

// How far the handle can go until the links are stretched or folded.
export function paintReach(context, view, { reach }) {
  if (!reach.length) return;
  view.pen(context, view.colours.contact, 2, [2, 5]);
  path(context, reach.map((place) => view.plane.toPixels(place)));
  context.stroke();
}

export function paintLinks(context, view, linkage, handle) {
  const { plane, colours } = view;
  const found = links(linkage, handle).map((places) => places.map((place) => plane.toPixels(place)));
  if (linkage.sector) paintSector(context, view, linkage.sector, handle);
  Object.assign(context, { lineCap: "round", lineJoin: "round" });
  for (const [colour, width] of [[colours.ink, 9], [colours.fixed, 6]]) {
    view.pen(context, colour, width);
    for (const places of found) stroke(context, places);
  }
  Object.assign(context, { lineCap: "butt", lineJoin: "miter", fillStyle: colours.panel });
  view.pen(context, colours.ink, 1.5);
  for (const [motor, elbow] of found) {
    ring(context, motor, 9 * plane.ratio);
    ring(context, motor, 3 * plane.ratio);
    if (!linkage.sector) ring(context, elbow, 4 * plane.ratio);
  }
}

// The sector turns with its handle; the motor's pulley rolls it on.
function paintSector(context, view, { pivot, radii: [handleRadius, radius, pulley] }, [x]) {
  const { plane, colours } = view;
  const turned = (x - pivot[0]) / handleRadius;
  const rim = Array.from({ length: 25 }, (_, i) => {
    const angle = DOWN[0] + ((DOWN[1] - DOWN[0]) * i) / 24 + turned;
    return plane.toPixels([pivot[0] - radius * Math.sin(angle), pivot[1] - radius * Math.cos(angle)]);
  });
  view.pen(context, colours.ink, 1.5);
  context.fillStyle = colours.fixed;
  path(context, [plane.toPixels(pivot), ...rim]);
  context.fill();
  context.stroke();
  context.fillStyle = colours.panel;
  ring(context, plane.toPixels([pivot[0], pivot[1] - radius - pulley]), pulley * plane.scale);
}

function ring(context, place, r) {
  circle(context, place, r);
  context.fill();
  context.stroke();
}
