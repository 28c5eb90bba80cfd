// SPDX-License-Identifier: Apache-2.0
// Strips of the last seconds, with axes and units.

import { line } from "./pen.js";
import { niceStep } from "./plane.js";
import { colours } from "./theme.js";

const SECONDS = 10;

export class Strip {
  // curves: [{label, colour (a CSS variable), dash}], in the order of the numbers given to push.
  constructor(canvas, curves, least) {
    this.canvas = canvas;
    this.curves = curves;
    this.least = least;
    this.points = [];
    this.recolour();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  recolour() {
    const named = this.curves.map((curve) => curve.colour);
    const found = colours(["soft", "line", "panel", ...named]);
    [this.ink, this.grid, this.ground] = [found.soft, found.line, found.panel];
    this.colours = named.map((name) => found[name]);
    this.draw();
  }

  push(time, numbers) {
    this.points.push([time, ...numbers]);
    while (this.points.length && this.points[0][0] < time - SECONDS) this.points.shift();
  }

  // Nothing where it is not seen.
  draw() {
    if (!this.canvas.clientWidth) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [this.canvas.clientWidth * ratio, this.canvas.clientHeight * ratio].map(Math.round);
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext("2d", { alpha: false });
    context.fillStyle = this.ground;
    context.fillRect(0, 0, width, height);
    const box = { left: 38 * ratio, top: 6 * ratio, right: width - 4 * ratio, bottom: height - 14 * ratio, ratio };
    const [low, high, step] = this.range();
    this.drawAxes(context, box, low, high, step);
    this.curves.forEach((curve, i) => this.drawCurve(context, box, low, high, i));
    this.drawLegend(context, box);
  }

  range() {
    let [low, high] = [0, this.least];
    for (const [, ...numbers] of this.points) {
      for (const number of numbers) {
        if (number < low) low = number;
        if (number > high) high = number;
      }
    }
    const step = niceStep((high - low) / 3);
    return [Math.floor(low / step) * step, Math.ceil(high / step) * step, step];
  }

  drawAxes(context, box, low, high, step) {
    context.font = `${10 * box.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    context.fillStyle = this.ink;
    context.strokeStyle = this.grid;
    context.lineWidth = box.ratio;
    context.textAlign = "right";
    for (let value = low; value <= high + 1e-9 * step; value += step) {
      const y = box.bottom - ((value - low) / (high - low)) * (box.bottom - box.top);
      line(context, box.left, y, box.right, y);
      context.fillText(String(Number(value.toPrecision(3))), box.left - 4 * box.ratio, y + 3 * box.ratio);
    }
    context.textAlign = "left";
    context.fillText(`−${SECONDS} s`, box.left, box.bottom + 12 * box.ratio);
  }

  drawCurve(context, box, low, high, i) {
    if (!this.points.length) return;
    const now = this.points[this.points.length - 1][0];
    context.strokeStyle = this.colours[i];
    context.lineWidth = 1.6 * box.ratio;
    context.setLineDash(this.curves[i].dash ? [5 * box.ratio, 4 * box.ratio] : []);
    context.beginPath();
    let drawing = false;
    for (const point of this.points) {
      const value = point[i + 1];
      if (value === null || value === undefined || Number.isNaN(value)) {
        drawing = false;
        continue;
      }
      const x = box.right - ((now - point[0]) / SECONDS) * (box.right - box.left);
      const y = box.bottom - ((value - low) / (high - low)) * (box.bottom - box.top);
      if (drawing) context.lineTo(x, y);
      else context.moveTo(x, y);
      drawing = true;
    }
    context.stroke();
    context.setLineDash([]);
  }

  drawLegend(context, box) {
    let x = box.left + 50 * box.ratio;
    context.textAlign = "left";
    this.curves.forEach((curve, i) => {
      context.strokeStyle = this.colours[i];
      context.lineWidth = 2 * box.ratio;
      context.setLineDash(curve.dash ? [4 * box.ratio, 3 * box.ratio] : []);
      line(context, x, box.bottom + 8 * box.ratio, x + 16 * box.ratio, box.bottom + 8 * box.ratio);
      context.setLineDash([]);
      context.fillStyle = this.ink;
      context.fillText(curve.label, x + 20 * box.ratio, box.bottom + 12 * box.ratio);
      x += 30 * box.ratio + context.measureText(curve.label).width;
    });
  }
}
