// SPDX-License-Identifier: Apache-2.0
// Two dots on each wall in the plane, for pointers: one moves the wall along its normal, the other turns it. Keys have
// the sliders of the panel.

import { element } from "./element.js";
import { along, onto } from "./wall.js";

const ARM = 70; // CSS pixels between the two dots
const PERIOD = 100; // ms between two wishes

export class WallDots {
  constructor(place, view, walls) {
    this.place = place;
    this.view = view;
    this.walls = walls;
    this.dots = [];
  }

  // To be called with each picture: the dots stay where their walls are, and a wall that waits for the hand goes on.
  follow() {
    const { walls } = this.walls;
    if (walls.length !== this.dots.length && !this.walls.dragged) this.build(walls.length);
    this.drag();
    for (const [i, dots] of this.dots.entries()) if (walls[i]) this.put(walls[i], i, dots);
  }

  build(count) {
    this.dots = Array.from({ length: count }, (_, i) => ({ move: this.dot("move", i), turn: this.dot("turn", i) }));
    this.place.replaceChildren(...this.dots.flatMap(({ move, turn }) => (this.walls.axes < 2 ? [move] : [move, turn])));
  }

  dot(kind, i) {
    const dot = element("span", { className: `dot ${kind}`, textContent: kind === "move" ? "⇕" : "↻" });
    dot.dataset.wall = i + 1;
    dot.addEventListener("pointerdown", (event) => this.grab(event, kind, i));
    dot.addEventListener("pointermove", (event) => {
      if (this.walls.dragged?.pointer === event.pointerId) this.walls.dragged.at = this.metres(event);
    });
    for (const name of ["pointerup", "pointercancel"]) dot.addEventListener(name, (event) => this.drop(event));
    return dot;
  }

  put(wall, i, { move, turn }) {
    const [nx, ny] = wall.normal;
    let place = this.pixels(this.walls.places[i]);
    if (!this.seen(place) && !this.walls.dragged) {
      this.walls.places[i] = onto(wall, this.view.plane.middle);
      place = this.pixels(this.walls.places[i]);
    }
    set(move, place, Math.atan2(nx, ny));
    set(turn, [place[0] + ARM * ny, place[1] + ARM * nx], 0);
  }

  seen([x, y]) {
    const { clientWidth, clientHeight } = this.view.canvas;
    return x > 0 && y > 0 && x < clientWidth && y < clientHeight;
  }

  grab(event, kind, i) {
    if (event.button !== 0 || this.walls.dragged) return;
    event.preventDefault();
    event.target.setPointerCapture(event.pointerId);
    const at = this.metres(event);
    this.walls.dragged = { kind, i, at, from: at, place: this.walls.places[i], wall: this.walls.walls[i], pointer: event.pointerId, due: 0, dot: event.target };
  }

  drop(event) {
    if (this.walls.dragged?.pointer !== event.pointerId) return;
    this.walls.dragged.due = 0;
    this.drag();
    this.walls.dragged = null;
  }

  drag() {
    const { dragged } = this.walls;
    if (!dragged || performance.now() < dragged.due || dragged.at === dragged.from) return;
    const wanted = JSON.stringify(dragged.at);
    if (wanted === dragged.asked && !dragged.waits) return;
    dragged.due = performance.now() + PERIOD;
    dragged.asked = wanted;
    if (dragged.kind === "turn") this.turn(dragged);
    else this.move(dragged);
  }

  move(dragged) {
    const { i, at, from, wall } = dragged;
    const offset = wall.offset + along(wall.normal, [at[0] - from[0], at[1] - from[1]]);
    this.walls.change(i, { ...this.walls.walls[i], offset }, dragged);
    dragged.waits = this.walls.walls[i].offset !== offset;
  }

  // The turning dot stands to the right of the other, as seen from the wall's normal.
  turn(dragged) {
    const [x, y] = dragged.place;
    const angle = Math.atan2(dragged.at[1] - y, dragged.at[0] - x) + Math.PI / 2;
    const degrees = Math.round(((angle * 180) / Math.PI + 540) % 360) - 180;
    this.walls.turn(dragged.i, degrees, dragged.place, dragged);
    dragged.waits = false;
  }

  pixels(place) {
    return this.view.plane.toPixels(place).map((pixel) => pixel / this.view.plane.ratio);
  }

  metres(event) {
    const { plane, canvas } = this.view;
    const box = canvas.getBoundingClientRect();
    const [x0, y0] = this.pixels([0, 0]);
    const size = plane.ratio / plane.scale;
    return [(event.clientX - box.left - x0) * size, (y0 - event.clientY + box.top) * size];
  }
}

function set(dot, [x, y], angle) {
  const at = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%) rotate(${angle.toFixed(3)}rad)`;
  if (dot.style.transform !== at) dot.style.transform = at;
}
