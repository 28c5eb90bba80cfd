// SPDX-License-Identifier: Apache-2.0
// The panel of the servo's walls: one is added, moved, turned, made stiffer and removed, always all of its values at once.

import { byId, element } from "./element.js";
import { say } from "./refusals.js";
import { slider } from "./slider.js";
import { angleOf, aside, besides, onto, turned, valuesOf, wallsOf, yielding } from "./wall.js";

const LATELY = 1500; // ms after a wish in which what the driver had before is not shown, unless it has answered
const REACH = 200; // mm from the middle of the workspace, where it is not known

export class Walls {
  // set: ({name: value}, thing) asks the driver.
  constructor(view, set) {
    this.view = view;
    this.set = set;
    this.walls = [];
    this.places = []; // on each wall, about which it turns
    this.rows = [];
    this.passive = {};
    this.axes = 2;
    this.asked = -Infinity;
    byId("add_wall").addEventListener("click", () => this.add());
  }

  build(declarations) {
    this.declared = Object.fromEntries(declarations.map((one) => [one.name, one]));
  }

  // What the driver has; walls that are being changed are left alone.
  show({ values, passive, damping, workspace, linkage }) {
    this.known = values.haptic_driver ?? {};
    this.passive = passive;
    this.axes = damping.length || 2;
    Object.assign(this, { workspace, linkage });
    byId("add_wall").disabled = !("wall.offsets" in this.known);
    const told = JSON.stringify(valuesOf(wallsOf(this.known)));
    const lately = performance.now() < this.asked + LATELY && told !== this.wanted;
    if (!this.dragged && !lately) this.take(wallsOf(this.known));
    if (told !== this.told && !this.noted) this.say(-1, "");
    this.told = told;
  }

  take(walls) {
    this.walls = walls;
    const middle = this.view.frame?.handle ?? this.view.plane.middle;
    this.places = walls.map((wall, i) => this.places[i] ?? aside(wall, middle)).map((place, i) => onto(walls[i], place));
    if (walls.length !== this.rows.length) this.buildRows();
    this.rows.forEach((row, i) => !row.edited && row.show(walls[i], this.passive, i));
    this.view.setSurroundings(walls.map(({ normal, offset }) => [...normal, offset]), this.workspace, this.linkage);
  }

  add() {
    const handle = this.view.frame?.handle;
    if (!handle) {
      this.say(-1, "Where the handle is, is not known yet: a wall cannot be put beside it.");
      return;
    }
    this.places.length = this.walls.length;
    this.ask([...this.walls, besides(handle, this.axes, this.passive.new_wall)], this.walls.length, Symbol("added"));
  }

  remove(i) {
    this.places.splice(i, 1);
    this.ask(this.walls.filter((_, j) => j !== i), -1, Symbol("removed"));
  }

  // Asks for another wall in the place of one. thing: which of it is changed.
  change(i, wanted, thing) {
    const wall = yielding(wanted, this.walls[i], this.view.frame?.handle);
    const walls = this.walls.map((old, j) => (j === i ? wall : old));
    this.thing = thing;
    if (JSON.stringify(valuesOf(walls)) !== JSON.stringify(valuesOf(this.walls))) this.ask(walls, i, thing);
    if (wall !== wanted) this.say(i, "The hand is in the way: the wall stops at it.", true);
  }

  turn(i, degrees, place, thing) {
    this.change(i, turned(this.walls[i], degrees, place), thing);
  }

  ask(walls, about, thing) {
    this.asked = performance.now();
    this.about = about;
    this.thing = thing;
    this.wanted = JSON.stringify(valuesOf(walls));
    this.say(-1, "");
    this.set(valuesOf(walls), thing);
    this.take(walls);
  }

  // The answer to a wish for walls, true; any other, false.
  answered({ to, done, sentence }) {
    if (!Object.keys(to.values).every((name) => name.startsWith("wall."))) return false;
    if (JSON.stringify(to.values) === this.wanted) this.asked = -Infinity;
    if (done) return true;
    const blamed = sentence.match(/ of wall (\d+)/);
    this.dragged = null;
    this.take(wallsOf(this.known ?? {}));
    this.say(blamed ? Number(blamed[1]) : this.about, sentence.replace(/ of wall \d+/, ""));
    return true;
  }

  // At the slider of the wall that was moved, at the wall, or, where it is no wall, below all. noted: it is no refusal.
  say(i, sentence, noted = false) {
    this.noted = noted;
    for (const answer of [byId("walls_answer"), ...this.rows.map((row) => row.answer)]) say(answer, "", true);
    const row = this.rows[i];
    const moved = row && [...row.set.querySelectorAll(".tuned")].find((line) => line.querySelector("[id]").id === this.thing);
    row && (moved ?? row.set).append(row.answer);
    say(row?.answer ?? byId("walls_answer"), sentence, noted);
  }

  buildRows() {
    this.rows = this.walls.map((_, i) => this.row(i));
    byId("wall_list").replaceChildren(...this.rows.map(({ set }) => set));
  }

  row(i) {
    const set = element("fieldset", { className: "wall" });
    const answer = element("p", { className: "answer", id: `wall_${i + 1}_answer` });
    answer.setAttribute("role", "status");
    const remove = element("button", { type: "button", textContent: "Remove", id: `wall_${i + 1}_remove` });
    remove.setAttribute("aria-label", `Remove wall ${i + 1}`);
    remove.addEventListener("click", () => this.remove(i));
    const parts = this.sliders(i);
    set.append(element("legend", { textContent: `Wall ${i + 1}` }), ...parts.map(({ row }) => row), remove, answer);
    const row = { set, answer, edited: false, show: (...given) => parts.forEach(({ show }) => show(...given)) };
    set.addEventListener("input", () => (row.edited = true));
    for (const name of ["change", "focusout"]) set.addEventListener(name, () => (row.edited = false));
    return row;
  }

  sliders(i) {
    const [reach, far] = [this.reach(), 1e3 * this.declared["wall.offsets"].high];
    const wall = () => this.walls[i];
    const gain = (words, name) => this.line(i, words, `wall.${name}`, { ...this.declared[`wall.${name}`], kind: "number" },
      (value, thing) => this.change(i, { ...wall(), [name]: value }, thing), (one, passive) => [one[name], passive[`wall.${name}`]?.[i]]);
    const place = this.line(i, "Place", "wall.offsets", { unit: "mm", low: -far, high: far, felt: [-reach, reach], steps: 4 * reach, even: true },
      (value, thing) => this.change(i, { ...wall(), offset: 1e-3 * value }, thing), (one) => [Number((1e3 * one.offset).toFixed(2))]);
    const direction = this.line(i, "Direction", "wall.normals", { unit: "°", low: -180, high: 180, steps: 360, even: true },
      (value, thing) => this.turn(i, value, this.places[i], thing), (one) => [angleOf(one)]);
    const damping = gain("Damping", "damping");
    damping.row.dataset.layer = "expert";
    return [place, ...(this.axes < 2 ? [] : [direction]), gain("Stiffness", "stiffness"), damping];
  }

  // One slider with its label; read(wall, passive) gives what is shown.
  line(i, words, name, declared, ask, read) {
    const id = `wall_${i + 1}_${words.toLowerCase()}`;
    const label = element("label", { htmlFor: id, textContent: `${words} [${declared.unit}] ` });
    const expert = element("small", { textContent: name });
    expert.dataset.layer = "expert";
    label.append(expert);
    const { parts, show } = slider({ ...declared, name: `${words} of wall ${i + 1}` }, id, (value) => ask(value, id));
    const row = element("div", { className: "tuned" });
    row.append(label, ...parts);
    parts[0].setAttribute("aria-label", `${words} of wall ${i + 1}`);
    return { row, show: (wall, passive) => show(...read(wall, passive)) };
  }

  // How far from the origin a wall can matter [mm].
  reach() {
    if (!this.workspace) return REACH;
    const [x, y = [0, 0]] = this.workspace;
    const corner = Math.hypot(Math.max(...x.map(Math.abs)), Math.max(...y.map(Math.abs)));
    return 10 * Math.ceil(100 * corner);
  }
}
