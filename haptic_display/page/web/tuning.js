// SPDX-License-Identifier: Apache-2.0
// Sliders, switches and fields made from the declarations of the driver's live parameters; walls have their own panel.

import { element } from "./element.js";
import { say } from "./refusals.js";
import { slider } from "./slider.js";

const OPEN = ["coupling", "cancellation"];
const WALLS = "wall";

export class Tuning {
  // set: ({name: value}, thing) asks the driver. words: {name: plain words}, if these few are shown and no others.
  constructor(place, set, words = null) {
    this.place = place;
    this.set = set;
    this.words = words;
    this.fields = {};
    this.told = "";
  }

  build(declarations) {
    this.fields = {};
    if (this.words) {
      this.place.replaceChildren(...declarations.filter(({ name }) => name in this.words).map((one) => this.field(one)));
      return;
    }
    const groups = {};
    for (const declared of declarations) (groups[declared.name.split(".")[0]] ??= []).push(declared);
    const names = [...OPEN, ...Object.keys(groups).filter((group) => !OPEN.includes(group) && group !== WALLS)];
    this.place.replaceChildren(...names.filter((name) => groups[name]).map((name) => this.group(name, groups[name])));
  }

  group(name, declared) {
    const details = element("details");
    details.open = OPEN.includes(name);
    details.append(element("summary", { textContent: name }), ...declared.map((one) => this.field(one)));
    return details;
  }

  field(declared) {
    const words = this.words?.[declared.name];
    const id = `${words ? "gain" : "tuned"}_${declared.name.replaceAll(".", "_")}`;
    const row = element("div", { className: "tuned" });
    const label = element("label", { htmlFor: id, textContent: `${words ?? declared.name}${declared.unit ? ` [${declared.unit}]` : ""} ` });
    if (!words) label.append(element("small", { textContent: declared.meaning + limits(declared) }));
    const answer = element("p", { className: "answer", id: `${id}_answer` });
    answer.setAttribute("role", "status");
    const ask = (value) => this.ask(declared.name, value);
    const { inputs, show, parts = inputs } = makers[declared.kind]({ ...declared, name: words ?? declared.name }, id, ask);
    row.append(label, ...parts, answer);
    const field = { show, answer, inputs, edited: false };
    row.addEventListener("input", () => {
      field.edited = true;
      answer.textContent = "";
    });
    for (const name of ["change", "focusout"]) row.addEventListener(name, () => (field.edited = false));
    this.fields[declared.name] = field;
    return row;
  }

  ask(name, value) {
    this.fields[name].asked = performance.now();
    this.set({ [name]: value }, name);
  }

  // What the nodes have now; a field that is being edited, or was just asked for, is left alone. passive: {name: range}.
  show(values, passive) {
    this.values = values;
    this.passive = passive;
    const told = JSON.stringify(values);
    for (const [name, field] of Object.entries(this.fields)) {
      const recent = field.edited || performance.now() < (field.asked ?? 0) + 1500;
      const used = recent && field.inputs.includes(document.activeElement);
      if (name in values && !used) field.show(values[name], passive[name]);
      for (const input of field.inputs) input.disabled = !(name in values);
      if (told !== this.told) field.answer.textContent = ""; // what was refused then may be right now
    }
    this.told = told;
  }

  // The answer to a wish for one of these, true; any other, false.
  answered({ to, done, sentence }) {
    const [name, ...others] = Object.keys(to.values);
    const field = this.fields[name];
    if (!field || others.length) return false;
    if (!done && name in this.values) field.show(this.values[name], this.passive[name]);
    say(field.answer, done ? "" : sentence, done);
    return true;
  }
}

const makers = {
  number: slider,
  whole: slider,
  switch: (declared, id, ask) => {
    const input = element("input", { type: "checkbox", id });
    input.addEventListener("change", () => ask(input.checked));
    return { inputs: [input], show: (value) => (input.checked = value) };
  },
  text: (declared, id, ask) => {
    const input = element(declared.choices.length ? "select" : "input", { id, className: "wide" });
    for (const choice of declared.choices) input.append(element("option", { textContent: choice }));
    input.addEventListener("change", () => ask(input.value));
    return { inputs: [input], show: (value) => (input.value = value) };
  },
};

export function limits({ low, high }) {
  return low === null || high === null ? "" : ` (${low} to ${high})`;
}
