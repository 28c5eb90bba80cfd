// SPDX-License-Identifier: Apache-2.0
// The time of the film: played, scrubbed, stepped.

import { byId, put } from "./element.js";

const STEP = 0.5; // s for an arrow with Shift

export class Player {
  // shown: (time [s]) is called whenever it is another one.
  constructor(begin, end, rate, shown) {
    Object.assign(this, { begin, end, rate, shown, time: begin, speed: 1, playing: false, before: null });
    Object.assign(byId("time"), { min: begin, max: Math.max(end, begin + 1e-3), value: begin });
    byId("time").addEventListener("input", () => this.go(Number(byId("time").value)));
    byId("play").addEventListener("click", () => this.toggle());
    this.speeds = [...document.querySelectorAll("[data-speed]")];
    for (const button of this.speeds) button.addEventListener("click", () => this.setSpeed(Number(button.dataset.speed)));
    document.addEventListener("keydown", (event) => this.press(event), { capture: true });
    this.setSpeed(1);
    this.toggle(false);
    this.go(begin);
  }

  setSpeed(speed) {
    this.speed = speed;
    for (const button of this.speeds) button.setAttribute("aria-pressed", String(Number(button.dataset.speed) === speed));
  }

  toggle(on = !this.playing) {
    if (on && this.time >= this.end) this.go(this.begin);
    this.playing = on;
    this.before = null;
    byId("play").textContent = on ? "Pause" : "Play";
    put(byId("state"), on ? "playing" : "paused");
  }

  go(time) {
    this.time = Math.min(this.end, Math.max(this.begin, time));
    byId("time").value = this.time;
    const text = `${this.time.toFixed(2).replace("-", "−")} s`;
    byId("time").setAttribute("aria-valuetext", text);
    byId("clock").textContent = `${text} of ${this.end.toFixed(2)} s`;
    this.shown(this.time);
  }

  // now [ms]: of the picture that the browser is about to draw.
  keepUp(now) {
    if (!this.playing) return;
    const elapsed = this.before === null ? 0 : (now - this.before) / 1e3;
    this.before = now;
    this.go(this.time + this.speed * elapsed);
    if (this.time >= this.end) this.toggle(false);
  }

  press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === " " && event.target.tagName === "BUTTON") return; // it presses that button
    const step = event.shiftKey ? STEP : 1 / this.rate;
    const act = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.go(this.time - step),
      ArrowRight: () => this.go(this.time + step),
      Home: () => this.go(this.begin),
      End: () => this.go(this.end),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation(); // these lead no hand here
    act();
  }
}
