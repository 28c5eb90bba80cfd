// SPDX-License-Identifier: Apache-2.0
// What this page has changed of the driver's values: back, forward again, and as it all began.

const MOST = 100; // steps that are kept
const TOGETHER = 1000; // ms between two changes of the same thing that are one step: a slider is drawn
const FORGOTTEN = 3000; // ms after which what was asked for and never answered counts as ignored
const TEXTS = "input[type=number], input[type=text], input:not([type]), textarea";

export class History {
  // set: ({name: value}) asks the driver.
  constructor(set, { undo, redo, defaults }) {
    this.send = set;
    this.wishes = []; // that no answer has come to, the oldest first
    this.buttons = { undo, redo, defaults };
    this.values = this.began = {};
    this.back = [];
    this.forward = [];
    undo.addEventListener("click", () => this.undo());
    redo.addEventListener("click", () => this.redo());
    defaults.addEventListener("click", () => this.ask(this.differing(this.began), Symbol("defaults")));
    document.addEventListener("keydown", (event) => this.key(event));
  }

  // Sets values, and remembers what they were. thing: what is changed; the same again at once is the same step.
  ask(values, thing = Object.keys(values).join()) {
    const last = this.back.at(-1);
    if (last?.thing === thing && performance.now() < last.at + TOGETHER) last.at = performance.now();
    else this.keep(this.current(Object.keys(values)), thing);
    this.set(values);
  }

  // Asks for values, which count as the driver's until it answers.
  set(values) {
    this.wishes.push({ values, at: performance.now() });
    this.send(values);
  }

  // What has become of values that were asked for is in the driver's values by now.
  answered(values) {
    const wish = this.wishes.findIndex((one) => JSON.stringify(one.values) === JSON.stringify(values));
    if (wish >= 0) this.wishes.splice(wish, 1);
    this.showButtons();
  }

  // Remembers what all are now, before something else sets them.
  keepAll() {
    this.keep(this.current(Object.keys(this.began)), Symbol("all"));
  }

  keep(before, thing) {
    this.back = [...this.back.slice(1 - MOST), { before, thing, at: performance.now() }];
    this.forward = [];
    this.showButtons();
  }

  undo() {
    this.step(this.back, this.forward);
  }

  redo() {
    this.step(this.forward, this.back);
  }

  // Steps that were refused, or taken back by others, differ in nothing: they are passed over.
  step(from, to) {
    while (from.length) {
      const values = this.differing(from.pop().before);
      const names = Object.keys(values);
      if (!names.length) continue;
      to.push({ before: this.current(names) });
      this.set(values);
      break;
    }
    this.showButtons();
  }

  // What the driver has now, and had when the viewer first heard of it.
  show(values, began) {
    this.values = values;
    this.began = began;
    this.wishes = this.wishes.filter(({ at }) => performance.now() < at + FORGOTTEN);
    this.showButtons();
  }

  // The driver's values, as they are once it has taken what was asked for.
  get known() {
    return Object.assign({}, this.values, ...this.wishes.map(({ values }) => values));
  }

  showButtons() {
    const differs = ({ before }) => Object.keys(this.differing(before)).length > 0;
    this.buttons.undo.disabled = !this.back.some(differs);
    this.buttons.redo.disabled = !this.forward.some(differs);
    this.buttons.defaults.disabled = !differs({ before: this.began });
  }

  current(names) {
    const { known } = this;
    return Object.fromEntries(names.filter((name) => name in known).map((name) => [name, known[name]]));
  }

  differing(wanted) {
    const { known } = this;
    const differs = ([name, value]) => name in known && JSON.stringify(value) !== JSON.stringify(known[name]);
    return Object.fromEntries(Object.entries(wanted).filter(differs));
  }

  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.matches?.(TEXTS)) return;
    const key = event.key.toLowerCase();
    const forward = key === "y" || (key === "z" && event.shiftKey);
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    if (forward) this.redo();
    else this.undo();
  }
}
