// SPDX-License-Identifier: Apache-2.0
// The plots below the plane: one span of time for all, one cursor through all. Of the second recording, the first curve.

import { paintCurve, paintLegend, paintLevels, rangeOf, shortly } from "./chart.js";
import { line } from "./pen.js";
import { niceStep } from "./plane.js";

const PLOTS = [
  ["force", [["felt", "felt", "handle"], ["motor", "motor", "force"]], 1],
  ["stretch", [["stretch", "stretch", "coupling"]], 1],
  ["energy", [["given", "to the operator", "handle"], ["supplied", "to the tool", "tool"]], 1],
  ["age", [["age", "mean", "coupling"], ["oldest", "oldest", "force"]], 2],
];
const SHORTEST = 0.1; // s that a plot shows at least
const CLICK = 4; // pixels within which a drag is a click

export class Plots {
  // go: (time [s]) for a click in a plot.
  constructor(recordings, begin, end, go) {
    Object.assign(this, { recordings, begin, end: Math.max(end, begin + SHORTEST), go, cursor: begin });
    this.plots = PLOTS.map(([name, curves, least]) => new Plot(document.getElementById(`plot_${name}`), name, curves, least, this));
    const middle = () => Math.min(this.to, Math.max(this.from, this.cursor));
    const press = (id, act) => document.getElementById(id).addEventListener("click", act);
    press("closer", () => this.zoom(middle(), 0.5));
    press("wider", () => this.zoom(middle(), 2));
    press("whole", () => this.look(this.begin, this.end));
    this.look(this.begin, this.end);
  }

  zoom(middle, factor) {
    const half = (factor * (this.to - this.from)) / 2;
    this.look(middle - half, middle + half);
  }

  // Which times are shown.
  look(from, to) {
    const length = Math.min(this.end - this.begin, Math.max(SHORTEST, to - from));
    this.from = Math.min(this.end - length, Math.max(this.begin, from));
    this.to = this.from + length;
    this.stale = true;
    document.documentElement.dataset.shown = `${this.from.toFixed(2)} to ${this.to.toFixed(2)}`;
  }

  recolour() {
    this.stale = true;
  }

  show(time) {
    const fresh = this.plots.map((plot) => plot.resize()).some(Boolean);
    if (time === this.cursor && !this.stale && !fresh) return;
    this.cursor = time;
    if (this.stale || fresh) for (const plot of this.plots) plot.paint();
    this.stale = false;
    for (const plot of this.plots) plot.show(time);
  }
}

class Plot {
  constructor(canvas, name, curves, least, plots) {
    Object.assign(this, { canvas, name, curves, least, plots, still: document.createElement("canvas"), span: null });
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("pointerup", (event) => this.drop(event));
    canvas.addEventListener("pointercancel", () => this.drop(null));
    canvas.addEventListener("dblclick", () => plots.look(plots.begin, plots.end));
  }

  grab(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.span = [event.offsetX, event.offsetX];
  }

  drag(event) {
    if (!this.span) return;
    this.span[1] = event.offsetX;
    this.show(this.plots.cursor);
  }

  drop(event) {
    const [from, to] = [...(this.span ?? [])].sort((a, b) => a - b);
    this.span = null;
    if (!event || from === undefined) return;
    if (to - from < CLICK) this.plots.go(this.timeAt(to));
    else this.plots.look(this.timeAt(from), this.timeAt(to));
  }

  timeAt(pixels) {
    const { left, right, ratio } = this.box;
    return this.plots.from + ((pixels * ratio - left) / (right - left)) * (this.plots.to - this.plots.from);
  }

  xOf(time) {
    const { from, to } = this.plots;
    return this.box.left + ((time - from) / (to - from)) * (this.box.right - this.box.left);
  }

  resize() {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((size) => Math.max(1, Math.round(size * ratio)));
    this.box = { left: 44 * ratio, top: 8 * ratio, right: width - 8 * ratio, bottom: height - 32 * ratio, ratio };
    if (this.canvas.width === width && this.canvas.height === height) return false;
    for (const one of [this.canvas, this.still]) Object.assign(one, { width, height });
    return true;
  }

  // All but the cursor.
  paint() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this.ink = colour("ink");
    const context = this.still.getContext("2d", { alpha: false });
    context.fillStyle = colour("panel");
    context.fillRect(0, 0, this.still.width, this.still.height);
    const lines = this.lines(colour);
    const range = this.range(lines);
    paintLevels(context, this.box, range, colour("soft"), colour("line"));
    this.paintTimes(context);
    for (const one of lines) paintCurve(context, this.box, range, one.values.map((value, i) => [this.xOf(one.of.begin + i / one.of.rate), value]), one);
    this.paintMarks(context, colour("soft"));
    paintLegend(context, this.box, this.box.left, this.box.bottom + 24 * this.box.ratio, lines);
    if (!lines.length) context.fillText("not recorded", this.box.left + 8 * this.box.ratio, this.box.top + 16 * this.box.ratio);
  }

  lines(colour) {
    const [first, second] = this.plots.recordings;
    const own = this.curves.map(([name, label, hue], i) => ({ of: first, values: first.curves[name], label, colour: colour(hue), dash: i ? [5, 4] : [] }));
    const there = second && this.curves.find(([name]) => second.curves[name]);
    if (there) own.push({ of: second, values: second.curves[there[0]], label: `${there[1]}, ${second.name}`, colour: colour("second"), dash: [8, 3, 2, 3] });
    return own.filter(({ values }) => values);
  }

  range(lines) {
    const shown = lines.flatMap(({ of, values }) => {
      const [from, to] = [this.plots.from, this.plots.to].map((time) => Math.round((time - of.begin) * of.rate));
      return values.slice(Math.max(0, from), Math.max(0, to + 1));
    });
    return rangeOf(shown, this.least, 4);
  }

  paintTimes(context) {
    const { top, bottom, ratio } = this.box;
    const { from, to } = this.plots;
    const step = niceStep((to - from) / 8);
    context.textAlign = "center";
    for (let time = Math.ceil(from / step) * step; time <= to + 1e-9; time += step) {
      const x = this.xOf(time);
      line(context, x, top, x, bottom);
      context.fillText(`${shortly(time)} s`, x, bottom + 13 * ratio);
    }
  }

  paintMarks(context, colour) {
    context.strokeStyle = colour;
    context.setLineDash([2 * this.box.ratio, 3 * this.box.ratio]);
    for (const one of this.plots.recordings) for (const [time] of one.marks) this.vertical(context, one.shift + time);
    context.setLineDash([]);
  }

  vertical(context, time) {
    const x = this.xOf(time);
    if (x >= this.box.left && x <= this.box.right) line(context, x, this.box.top, x, this.box.bottom);
  }

  show(time) {
    const context = this.canvas.getContext("2d", { alpha: false });
    context.drawImage(this.still, 0, 0);
    context.strokeStyle = this.ink;
    context.lineWidth = 1.5 * this.box.ratio;
    this.vertical(context, time);
    if (!this.span) return;
    const [from, to] = this.span.map((pixels) => pixels * this.box.ratio);
    context.globalAlpha = 0.15;
    context.fillStyle = this.ink;
    context.fillRect(from, this.box.top, to - from, this.box.bottom - this.box.top);
    context.globalAlpha = 1;
  }
}
