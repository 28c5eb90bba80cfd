// SPDX-License-Identifier: Apache-2.0
// Strips of the last seconds, with axes and units; together they stand still, and show less of that time.

import { paintCurve, paintLegend, paintLevels, rangeOf, shortly } from "./chart.js";
import { colours } from "./theme.js";

const SECONDS = 10; // that are kept
const SHORTEST = 0.2; // s that are shown at least
const GAP = 1; // s without a point that no curve bridges

// seconds: that are seen; back [s]: before the newest point, where the right edge is, which is now unless they stand still.
export class Strips {
  // strips: [canvas, curves, least] of each.
  constructor(strips, { pause, closer, wider }) {
    Object.assign(this, { seconds: SECONDS, back: 0, paused: false });
    this.strips = strips.map(([canvas, curves, least]) => new Strip(canvas, curves, least, this));
    for (const { canvas } of this.strips) {
      canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        this.zoom(Math.exp(event.deltaY / 300), event.offsetX / canvas.clientWidth);
      }, { passive: false });
    }
    pause.addEventListener("click", () => this.pause(pause));
    closer.addEventListener("click", () => this.zoom(0.5));
    wider.addEventListener("click", () => this.zoom(2));
  }

  // What comes while they stand still is not kept.
  pause(button) {
    this.paused = !this.paused;
    button.setAttribute("aria-pressed", String(this.paused));
    this.back = 0;
  }

  // share: of the width, where the same time stays.
  zoom(factor, share = this.paused ? 0.5 : 1) {
    const before = this.seconds;
    this.seconds = Math.min(SECONDS, Math.max(SHORTEST, before * factor));
    if (this.paused) this.back = Math.min(SECONDS - this.seconds, Math.max(0, this.back + (1 - share) * (before - this.seconds)));
    this.strips.forEach((strip) => strip.draw());
  }

  // curves: of each strip, the numbers of its curves.
  push(time, curves) {
    if (!this.paused) this.strips.forEach((strip, i) => strip.push(time, curves[i]));
  }
}

class Strip {
  // curves: [{label, colour (a CSS variable), dash}], in the order of the numbers given to push. span: what is seen.
  constructor(canvas, curves, least, span) {
    Object.assign(this, { canvas, curves, least, span, points: [] });
    this.recolour();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  recolour() {
    this.colours = colours(["soft", "line", "panel", ...this.curves.map(({ colour }) => colour)]);
    this.draw();
  }

  push(time, numbers) {
    if (time > this.points.at(-1)?.[0] + GAP) this.points.push([time]);
    this.points.push([time, ...numbers]);
    while (this.points[0][0] < time - SECONDS) this.points.shift();
  }

  // Nothing where it is not seen.
  draw() {
    if (!this.canvas.clientWidth) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [this.canvas.clientWidth * ratio, this.canvas.clientHeight * ratio].map(Math.round);
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext("2d", { alpha: false });
    const { soft, line, panel } = this.colours;
    context.fillStyle = panel;
    context.fillRect(0, 0, width, height);
    this.paint(context, { left: 44 * ratio, top: 6 * ratio, right: width - 4 * ratio, bottom: height - 14 * ratio, ratio }, soft, line);
  }

  paint(context, box, ink, grid) {
    const { seconds, back } = this.span;
    const end = (this.points.at(-1)?.[0] ?? 0) - back;
    const seen = this.points.filter(([time]) => time >= end - seconds && time <= end);
    const range = rangeOf(seen.flatMap(([, ...numbers]) => numbers), this.least, 3);
    paintLevels(context, box, range, ink, grid);
    const written = box.bottom + 12 * box.ratio;
    if (back > 0) context.fillText(`−${shortly(Number(back.toFixed(1)))} s`, box.right, written);
    context.textAlign = "left";
    context.fillText(`−${shortly(Number((seconds + back).toFixed(1)))} s`, box.left, written);
    const curves = this.curves.map(({ label, colour, dash = [] }) => ({ label, colour: this.colours[colour], dash }));
    const xOf = (time) => box.right - ((end - time) / seconds) * (box.right - box.left);
    curves.forEach((curve, i) => paintCurve(context, box, range, seen.map((point) => [xOf(point[0]), point[i + 1]]), curve));
    paintLegend(context, box, box.left + 50 * box.ratio, box.bottom + 8 * box.ratio, curves);
  }
}
