// SPDX-License-Identifier: Apache-2.0
// The plane on the canvas: which part of the world is seen, and its axes in millimetres.

import { line } from "./pen.js";

const INSET = { side: 30, top: 64, bottom: 44 }; // CSS pixels for axes and read-outs

export class Plane {
  constructor(canvas) {
    this.canvas = canvas;
    this.room = [-0.1, -0.1, 0.1, 0.1];
    this.fit();
    this.resize();
  }

  // Shows all of the room.
  fit() {
    this.zoom = 1;
    this.shift = [0, 0]; // m from the middle of the room to what is seen in the middle
  }

  // By pixels of the page, to the right and down; something of the room stays in sight.
  pan(x, y) {
    const metres = this.ratio / this.scale;
    const [left, bottom, right, top] = this.room;
    const most = [(right - left) / 2, (top - bottom) / 2];
    this.shift = [this.shift[0] - x * metres, this.shift[1] + y * metres].map((way, i) => Math.min(most[i], Math.max(-most[i], way)));
  }

  // about: [x, y] in pixels of the canvas on the page, which shows the same place afterwards.
  zoomBy(factor, about = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2 + (INSET.top - INSET.bottom) / 2]) {
    const before = this.toWorld(about);
    this.zoom = Math.min(20, Math.max(0.1, this.zoom * factor));
    const [x, y] = this.toPixels(before);
    this.pan(about[0] - x / this.ratio, about[1] - y / this.ratio);
  }

  // Takes the canvas's size on the page; true if it has changed.
  resize() {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.canvas.width === width && this.canvas.height === height && this.ratio === ratio) return false;
    this.canvas.width = width;
    this.canvas.height = height;
    this.ratio = ratio;
    return true;
  }

  // Pixels of the canvas for each metre.
  get scale() {
    const [left, bottom, right, top] = this.room;
    const [width, height] = [this.canvas.width - 2 * INSET.side * this.ratio, this.canvas.height - (INSET.top + INSET.bottom) * this.ratio];
    const fits = Math.min(width / (right - left), height / (top - bottom));
    return Math.max(1, fits) * this.zoom;
  }

  get middle() {
    const [left, bottom, right, top] = this.room;
    return [(left + right) / 2 + this.shift[0], (bottom + top) / 2 + this.shift[1]];
  }

  toWorld([x, y]) {
    const [cx, cy] = this.middle;
    const [px, py] = this.toPixels([cx, cy]);
    return [cx + (x * this.ratio - px) / this.scale, cy - (y * this.ratio - py) / this.scale];
  }

  toPixels([x, y]) {
    const [cx, cy] = this.middle;
    return [this.canvas.width / 2 + (x - cx) * this.scale, this.canvas.height / 2 + ((INSET.top - INSET.bottom) / 2) * this.ratio - (y - cy) * this.scale];
  }

  // The pixels nearest to a place that are clear of axes and read-outs; null for one that is in view.
  edge(place) {
    const { width, height } = this.canvas;
    const [x, y] = this.toPixels(place);
    if (x >= 0 && x <= width && y >= 0 && y <= height) return null;
    const within = (value, size, low, high) => Math.max(low * this.ratio, Math.min(size - high * this.ratio, value));
    return [within(x, width, INSET.side, INSET.side), within(y, height, INSET.top, INSET.bottom)];
  }

  drawAxes(context, colours) {
    const step = 1e-3 * niceStep((70 * this.ratio) / this.scale / 1e-3);
    const [cx, cy] = this.middle;
    const halfWidth = this.canvas.width / 2 / this.scale;
    const halfHeight = this.canvas.height / 2 / this.scale;
    context.strokeStyle = colours.grid;
    context.fillStyle = colours.soft;
    context.lineWidth = this.ratio;
    context.font = `${11 * this.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    for (let x = Math.ceil((cx - halfWidth) / step) * step; x < cx + halfWidth; x += step) this.drawVertical(context, x);
    for (let y = Math.ceil((cy - 1.5 * halfHeight) / step) * step; y < cy + 1.5 * halfHeight; y += step) this.drawHorizontal(context, y);
    context.textAlign = "right";
    context.fillText("x [mm]", this.canvas.width - 6 * this.ratio, this.canvas.height - 5 * this.ratio);
    context.textAlign = "left";
    context.fillText("y [mm]", 4 * this.ratio, 14 * this.ratio);
  }

  drawVertical(context, x) {
    const [px] = this.toPixels([x, 0]);
    line(context, px, 0, px, this.canvas.height);
    context.textAlign = "center";
    if (px > 45 * this.ratio && px < this.canvas.width - 70 * this.ratio) context.fillText(inMillimetres(x), px, this.canvas.height - 5 * this.ratio);
  }

  drawHorizontal(context, y) {
    const [, py] = this.toPixels([0, y]);
    line(context, 0, py, this.canvas.width, py);
    context.textAlign = "left";
    if (py > 32 * this.ratio && py < this.canvas.height - 24 * this.ratio) {
      context.fillText(inMillimetres(y), 4 * this.ratio, py - 3 * this.ratio);
    }
  }
}

// 1, 2 or 5 times a power of ten, not below the least step.
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least);
}

function inMillimetres(metres) {
  return String(Number((1e3 * metres).toFixed(1)));
}
