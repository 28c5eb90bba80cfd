// SPDX-License-Identifier: Apache-2.0
// Parts of a chart on a canvas. box: left, top, right, bottom in its pixels, and ratio: of these to those of the page.

import { line } from "./pen.js";
import { niceStep } from "./plane.js";

// From 0, or the least of the numbers, to `least`, or the largest, in whole steps of which there are about so many.
export function rangeOf(numbers, least, count) {
  let [low, high] = [0, least];
  for (const number of numbers) {
    if (number < low) low = number;
    if (number > high) high = number;
  }
  const step = niceStep((high - low) / count);
  return { low: Math.floor(low / step) * step, high: Math.ceil(high / step) * step, step };
}

function yOf({ top, bottom }, { low, high }, value) {
  return bottom - ((value - low) / (high - low)) * (bottom - top);
}

// Lines across it with their values; font and colours hold for what is written next.
export function paintLevels(context, box, range, ink, grid) {
  const { left, right, ratio } = box;
  context.font = `${11 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
  context.fillStyle = ink;
  context.strokeStyle = grid;
  context.lineWidth = ratio;
  context.textAlign = "right";
  for (let value = range.low; value <= range.high + 1e-9; value += range.step) {
    const y = yOf(box, range, value);
    line(context, left, y, right, y);
    context.fillText(shortly(value), left - 5 * ratio, y + 4 * ratio);
  }
}

// points: [x in pixels, value]; what is no number is a gap.
export function paintCurve(context, box, range, points, { colour, dash }) {
  const { left, right, top, bottom, ratio } = box;
  context.save();
  context.beginPath();
  context.rect(left, top - 2 * ratio, right - left, bottom - top + 4 * ratio);
  context.clip();
  context.strokeStyle = colour;
  context.lineWidth = 1.6 * ratio;
  context.setLineDash(dash.map((pixels) => pixels * ratio));
  context.beginPath();
  let drawing = false;
  for (const [x, value] of points) {
    const known = Number.isFinite(value);
    if (known) context[drawing ? "lineTo" : "moveTo"](x, yOf(box, range, value));
    drawing = known;
  }
  context.stroke();
  context.restore();
}

// How each curve looks, and its label, in the row whose middle is y.
export function paintLegend(context, { ratio }, x, y, curves) {
  context.textAlign = "left";
  for (const { label, colour, dash } of curves) {
    context.strokeStyle = colour;
    context.lineWidth = 2 * ratio;
    context.setLineDash(dash.map((pixels) => pixels * ratio));
    line(context, x, y, x + 20 * ratio, y);
    context.setLineDash([]);
    context.fillText(label, x + 24 * ratio, y + 4 * ratio);
    x += 36 * ratio + context.measureText(label).width;
  }
}

export function shortly(value) {
  return String(Number(value.toPrecision(6))).replace("-", "−");
}
