// SPDX-License-Identifier: Apache-2.0
// The mouse, a finger or the keyboard leads the operator's hand: by how far it moves, from wherever the hand is. With the
// pointer let go the hand lets go, unless Hold is on; keys, wheel and buttons switch Hold on until the next pointer.

const STEP = 0.002; // m for an arrow key
const TURN = Math.PI / 180; // rad for Q, E, a button or a notch of the wheel
const KEYS = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], q: [0, 0, 1], e: [0, 0, -1] };
const PERSON = "person"; // who switched Hold on
const MOVES = "moves";

export class Hand {
  // hold: the button. lead: ({x, y, theta}) is called with what has changed, in m and rad, at most once for each frame
  // that the page draws; with null if there is no hand to lead. letGo: () is called when the hand shall let go.
  constructor(view, hold, lead, letGo) {
    Object.assign(this, { view, hold, lead, letGo });
    this.goal = null; // where this page wants the hand; null while it does not lead
    this.held = null; // the pointer that is down
    this.asked = null; // what lead is to be called with
    this.holds = "";
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.drop(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    hold.addEventListener("click", () => this.toggle());
  }

  // Who leads as the viewer says: "you", "other" or "none".
  ledBy(who) {
    if (who === "you") {
      if (!this.held && !this.holds) this.setHold(MOVES);
      return;
    }
    this.goal = this.asked = null;
    if (this.holds === MOVES || who === "other") this.setHold("");
    if (who === "other") this.drop(this.held);
    else if (this.held) this.held.lost = true; // the hand is elsewhere now: the pointer begins anew
  }

  // Moves the goal by (x, y) [m] and theta [rad].
  move(x, y, theta) {
    const start = this.begin();
    if (!start) return;
    if (!this.held && !this.holds) this.setHold(MOVES);
    this.goal = this.clamped([start[0] + x, start[1] + y, start[2] + theta]);
    const place = {};
    if (x || y) Object.assign(place, { x: start[0] + x, y: start[1] + y });
    if (theta) place.theta = start[2] + theta;
    this.ask(place);
  }

  begin() {
    if (this.goal === null) this.goal = this.view.frame?.target?.slice() ?? null;
    if (this.goal === null) this.lead(null);
    return this.goal;
  }

  clamped(goal) {
    const { workspace } = this.view;
    return goal.map((value, i) => (workspace?.[i] ? Math.min(workspace[i][1], Math.max(workspace[i][0], value)) : value));
  }

  ask(place) {
    if (this.asked === null) requestAnimationFrame(() => this.tell());
    this.asked = { ...this.asked, ...place };
  }

  tell() {
    if (this.asked) this.lead(this.asked);
    this.asked = null;
  }

  grab(event) {
    if (event.button !== 0 || this.held) return;
    this.view.canvas.setPointerCapture(event.pointerId);
    this.view.canvas.classList.add("held");
    this.view.canvas.focus({ preventScroll: true }); // a finger does not by itself, before it is lifted
    this.held = { pointerId: event.pointerId };
    this.anchor(event);
  }

  anchor(event) {
    Object.assign(this.held, { at: [event.clientX, event.clientY], start: this.begin()?.slice(), lost: false });
  }

  drag(event) {
    if (event.pointerId !== this.held?.pointerId) return;
    if (this.held.lost) this.anchor(event);
    if (!this.held.start) return;
    const metres = this.view.plane.ratio / this.view.plane.scale;
    const x = this.held.start[0] + (event.clientX - this.held.at[0]) * metres;
    const y = this.held.start[1] - (event.clientY - this.held.at[1]) * metres;
    this.goal = this.clamped([x, y, this.goal?.[2] ?? this.held.start[2]]);
    this.ask({ x, y });
  }

  drop(event) {
    if (!this.held || event.pointerId !== this.held.pointerId) return;
    this.held = null;
    this.view.canvas.classList.remove("held");
    if (this.holds === PERSON) this.tell();
    else this.release();
  }

  release() {
    const led = this.goal !== null;
    this.goal = this.asked = null;
    this.setHold("");
    if (led) this.letGo();
  }

  toggle() {
    if (!this.holds) this.setHold(PERSON);
    else if (this.held) this.setHold("");
    else this.release();
  }

  setHold(holds) {
    this.holds = holds;
    this.hold.setAttribute("aria-pressed", String(Boolean(holds)));
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? event.deltaY / 3 : event.deltaY / 100;
    this.move(0, 0, -lines * TURN);
  }

  key(event) {
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (name === "h" && !event.repeat) this.toggle();
    const way = KEYS[name];
    if (!way) return;
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
