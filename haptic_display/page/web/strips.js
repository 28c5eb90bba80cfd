// SPDX-License-Identifier: Apache-2.0
// Strips of the last seconds, with axes and units; together they stand still, and show less of that time.

import { paintCurve, paintLegend, paintLevels, rangeOf, shortly } from "./chart.js";
import { byId, element, put } from "./element.js";
import { shown } from "./panels.js";
import { line } from "./pen.js";
import { colours } from "./theme.js";

const SECONDS = 10; // that are kept
const SHORTEST = 0.2; // s that are shown at least
const GAP = 1; // s without a point that no curve bridges

// seconds: that are seen; back [s]: before the newest point, where the right edge is, which is now unless they stand still.
export class Strips {
  // strips: [canvas, curves, least] of each.
  constructor(strips, { pause, closer, wider }) {
    Object.assign(this, { seconds: SECONDS, most: SECONDS, back: 0, paused: false, share: 0.5, marks: [] });
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
  zoom(factor, share = this.paused ? this.share : 1) {
    const before = this.seconds;
    this.seconds = Math.min(this.most, Math.max(SHORTEST, before * factor));
    this.look(this.paused ? this.back + (1 - share) * (before - this.seconds) : this.back);
  }

  look(back) {
    this.back = Math.min(this.most - this.seconds, Math.max(0, back));
    this.strips.forEach((strip) => strip.draw());
    if (this.last !== undefined) byId("strips").dataset.shown = [this.seconds, 0].map((before) => (this.last - this.back - before).toFixed(2)).join(" to ");
  }

  // A whole recording, instead of what would be pushed: curves and points of each strip; marks [s]; go(time): a click.
  show({ charts, marks, go }) {
    const [first, last] = [charts[0].points[0], charts[0].points.at(-1)].map(([time]) => time);
    const most = Math.max(SHORTEST, last - first);
    Object.assign(this, { paused: true, most, seconds: most, marks, last });
    this.strips.forEach((strip, i) => strip.show(charts[i], go));
    for (const { canvas } of this.strips) canvas.addEventListener("dblclick", () => this.zoom(Infinity));
    this.look(0);
  }

  // The time at which the recording is; it is always seen.
  point(time) {
    const before = this.last - time;
    if (before < this.back || before > this.back + this.seconds) this.look(before - 0.9 * this.seconds);
    this.share = 1 - (before - this.back) / this.seconds;
    this.strips.forEach((strip) => strip.point(time));
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

  show({ curves, points }, go) {
    Object.assign(this, { curves, points, numbers: element("span"), cursor: element("i", { className: "cursor" }) });
    this.canvas.previousElementSibling.append(this.numbers);
    this.canvas.after(this.cursor);
    this.canvas.parentElement.hidden = false;
    this.canvas.addEventListener("click", ({ offsetX }) => go(this.timeAt(offsetX)));
    this.recolour();
  }

  timeAt(pixels) {
    const { left, right, ratio } = this.box;
    return this.end - ((right - pixels * ratio) / (right - left)) * this.span.seconds;
  }

  // A line at a time of the recording, and the numbers there.
  point(time) {
    const [first, last] = [this.points[0][0], this.points.at(-1)[0]];
    const [, ...numbers] = this.points[Math.round(((this.points.length - 1) * (time - first)) / (last - first || 1))];
    put(this.numbers, `: ${numbers.map((number) => shown(number, 2)).join(", ") || "–"}`);
    this.time = time;
    this.place();
  }

  place() {
    const { left, right, ratio } = this.box;
    const share = (this.time - this.end) / this.span.seconds;
    this.cursor.hidden = share > 0 || share < -1;
    this.cursor.style.left = `${this.canvas.offsetLeft + (right + share * (right - left)) / ratio}px`;
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
    const { soft, line: grid, panel } = this.colours;
    context.fillStyle = panel;
    context.fillRect(0, 0, width, height);
    this.box = { left: 44 * ratio, top: 6 * ratio, right: width - 4 * ratio, bottom: height - 14 * ratio, ratio };
    this.paint(context, this.box, soft, grid);
    if (this.cursor) this.place();
  }

  paint(context, box, ink, grid) {
    const { seconds, back, marks } = this.span;
    const last = this.points.at(-1)?.[0] ?? 0;
    const end = (this.end = last - back);
    const seen = this.points.filter(([time]) => time >= end - seconds && time <= end);
    const range = rangeOf(seen.flatMap(([, ...numbers]) => numbers), this.least, 3);
    paintLevels(context, box, range, ink, grid);
    const written = box.bottom + 12 * box.ratio;
    const said = (time) => `${shortly(Number((this.cursor ? time : time - last).toFixed(1)))} s`;
    if (back > 0 || this.cursor) context.fillText(said(end), box.right, written);
    context.textAlign = "left";
    context.fillText(said(end - seconds), box.left, written);
    const curves = this.curves.map(({ label, colour, dash = [] }) => ({ label, colour: this.colours[colour], dash }));
    const xOf = (time) => box.right - ((end - time) / seconds) * (box.right - box.left);
    curves.forEach((curve, i) => paintCurve(context, box, range, seen.map((point) => [xOf(point[0]), point[i + 1]]), curve));
    context.setLineDash([2 * box.ratio, 3 * box.ratio]);
    for (const x of marks.map(xOf)) if (x >= box.left && x <= box.right) line(context, x, box.top, x, box.bottom);
    context.setLineDash([]);
    paintLegend(context, box, box.left + 50 * box.ratio, box.bottom + 8 * box.ratio, curves);
  }
}
