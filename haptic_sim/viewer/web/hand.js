// SPDX-License-Identifier: Apache-2.0
// The mouse, a finger or the keyboard leads the operator's hand: by how far it moves, from wherever the hand is.

const REST = 400; // ms after which the next motion begins from where the hand's target is then
const STEP = 0.002; // m for an arrow key
const TURN = Math.PI / 180; // rad for Q, E, a button or a notch of the wheel
const KEYS = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], q: [0, 0, 1], e: [0, 0, -1] };

export class Hand {
  // lead: ({x, y, theta}) is called with what has changed, in m and rad; with null if there is no hand to lead.
  constructor(view, lead) {
    this.view = view;
    this.lead = lead;
    this.goal = this.held = null;
    this.moved = 0;
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.drop(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  // Moves the goal by (x, y) [m] and theta [rad].
  move(x, y, theta) {
    const start = this.begin();
    if (!start) return;
    this.goal = this.clamped([start[0] + x, start[1] + y, start[2] + theta]);
    const place = {};
    if (x || y) Object.assign(place, { x: start[0] + x, y: start[1] + y });
    if (theta) place.theta = start[2] + theta;
    this.lead(place);
  }

  begin() {
    const resting = performance.now() > this.moved + REST;
    this.moved = performance.now();
    if (this.goal === null || resting) this.goal = this.view.frame?.target?.slice() ?? null;
    if (this.goal === null) this.lead(null);
    return this.goal;
  }

  clamped(goal) {
    const { workspace } = this.view;
    return goal.map((value, i) => (workspace?.[i] ? Math.min(workspace[i][1], Math.max(workspace[i][0], value)) : value));
  }

  grab(event) {
    if (event.button !== 0 || this.held) return;
    this.view.canvas.setPointerCapture(event.pointerId);
    this.view.canvas.classList.add("held");
    this.goal = null;
    const start = this.begin();
    this.held = { id: event.pointerId, at: [event.clientX, event.clientY], start: start?.slice() };
  }

  drag(event) {
    if (!this.held || event.pointerId !== this.held.id || !this.held.start) return;
    const metres = this.view.plane.ratio / this.view.plane.scale;
    const x = this.held.start[0] + (event.clientX - this.held.at[0]) * metres;
    const y = this.held.start[1] - (event.clientY - this.held.at[1]) * metres;
    this.goal = this.clamped([x, y, this.goal?.[2] ?? this.held.start[2]]);
    this.moved = performance.now();
    this.lead({ x, y });
  }

  drop(event) {
    if (!this.held || event.pointerId !== this.held.id) return;
    this.held = null;
    this.view.canvas.classList.remove("held");
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? event.deltaY / 3 : event.deltaY / 100;
    this.move(0, 0, -lines * TURN);
  }

  key(event) {
    const way = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const share = event.shiftKey ? 0.1 : 1;
    this.move(way[0] * STEP * share, way[1] * STEP * share, way[2] * TURN * share);
  }
}

// A button that turns the hand as long as it is held, by pointer or by key.
export function turning(button, hand, sense) {
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
  };
  const begin = () => {
    if (timer !== null) return;
    hand.move(0, 0, sense * TURN);
    timer = setInterval(() => hand.move(0, 0, sense * TURN), 50);
  };
  button.addEventListener("pointerdown", begin);
  for (const name of ["pointerup", "pointerleave", "pointercancel", "blur", "keyup"]) button.addEventListener(name, stop);
  button.addEventListener("keydown", (event) => {
    if (event.key === " " || event.key === "Enter") begin();
  });
}
