// SPDX-License-Identifier: Apache-2.0
// Sliders, switches and fields made from the declarations of the driver's live parameters.

const OPEN = ["coupling", "wall", "cancellation"];
const STEPS = 1000;
const PERIOD = 100; // ms between two values of a slider that is being drawn
const SETTLED = 600; // ms that a slider whose value is dear must have been left alone: keys move it step by step

export class Tuning {
  // set: (name, value) asks the driver.
  constructor(place, set) {
    this.place = place;
    this.set = set;
    this.fields = {};
    this.values = {};
  }

  build(declarations) {
    this.place.replaceChildren();
    this.fields = {};
    const groups = {};
    for (const declared of declarations) (groups[declared.name.split(".")[0]] ??= []).push(declared);
    for (const name of [...OPEN, ...Object.keys(groups).filter((group) => !OPEN.includes(group))]) {
      if (groups[name]) this.place.append(this.group(name, groups[name]));
    }
  }

  group(name, declared) {
    const details = element("details");
    details.open = OPEN.includes(name);
    details.append(element("summary", { textContent: name }), ...declared.map((one) => this.field(one)));
    return details;
  }

  field(declared) {
    const id = `tuned_${declared.name.replaceAll(".", "_")}`;
    const row = element("div", { className: "tuned" });
    const label = element("label", { htmlFor: id });
    label.append(`${declared.name}${declared.unit ? ` [${declared.unit}]` : ""} `,
      element("small", { textContent: declared.meaning + limits(declared) }));
    const answer = element("p", { className: "answer", id: `${id}_answer` });
    answer.setAttribute("role", "status");
    const { inputs, show, parts = inputs } = makers[declared.kind](declared, id, (value) => this.ask(declared.name, value));
    row.append(label, ...parts, answer);
    const field = { show, answer, inputs, edited: false };
    row.addEventListener("input", () => (field.edited = true));
    for (const name of ["change", "focusout"]) row.addEventListener(name, () => (field.edited = false));
    this.fields[declared.name] = field;
    return row;
  }

  ask(name, value) {
    this.set(name, value);
  }

  // What the nodes have now; a field that is being edited, or was just asked for, is left alone.
  show(values) {
    this.values = values;
    for (const [name, field] of Object.entries(this.fields)) {
      const recent = field.edited || performance.now() < (field.asked ?? 0) + 1500;
      const used = recent && field.inputs.includes(document.activeElement);
      if (name in values && !used) field.show(values[name]);
      for (const input of field.inputs) input.disabled = !(name in values);
    }
  }

  answered({ to, done, sentence }) {
    const field = this.fields[to.name];
    if (!field) return;
    field.answer.textContent = done ? "" : sentence;
    field.answer.classList.toggle("refused", !done);
    if (!done && to.name in this.values) field.show(this.values[to.name]);
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
  list: (declared, id, ask) => (/stiffness|damping/.test(declared.name) ? sliders : listed)(declared, id, ask),
};

function listed(declared, id, ask) {
  const input = element("input", { type: "text", id, className: "wide", placeholder: "none" });
  input.addEventListener("change", () => ask(input.value.split(",").filter((item) => item.trim()).map(Number)));
  return { inputs: [input], show: (value) => (input.value = value.join(", ")) };
}

// One slider for the number of each wall; nothing where there is no wall.
function sliders(declared, id, ask) {
  const place = element("div", { className: "wide walls" });
  const inputs = []; // of all walls
  let made = [];
  let values = [];
  const build = () => {
    made = values.map((_, i) => slider({ ...declared, name: `${declared.name} of wall ${i + 1}` }, i ? `${id}_${i + 1}` : id, (value) => {
      values = values.map((old, j) => (j === i ? value : old));
      ask(values);
    }));
    made.forEach((one, i) => one.inputs[0].setAttribute("aria-label", `${declared.name} of wall ${i + 1}`));
    place.replaceChildren(...made.flatMap((one, i) => [element("span", { textContent: `wall ${i + 1}` }), ...one.inputs]));
    inputs.splice(0, inputs.length, ...made.flatMap((one) => one.inputs));
  };
  return {
    inputs,
    parts: [place],
    show: (given) => {
      values = given.slice();
      if (values.length !== made.length) build();
      place.parentElement.hidden = !values.length;
      made.forEach((one, i) => one.show(values[i]));
    },
  };
}

// A slider, finer at small values, and the number itself beside it. It asks while it is drawn, or, once: when let go.
export function slider(declared, id, ask, once = false) {
  const { low, high, unit } = declared;
  const power = high - low > 50 ? 3 : 1;
  const range = element("input", { type: "range", id, min: 0, max: STEPS });
  const number = element("input", { type: "number", min: low, max: high, step: "any" });
  number.setAttribute("aria-label", `${declared.name} as a number`);
  let due = 0;
  let last = null;
  const valueOf = () => {
    const value = Number((low + (high - low) * (range.value / STEPS) ** power).toPrecision(3));
    return declared.kind === "whole" ? Math.round(value) : Math.min(high, Math.max(low, value));
  };
  const describe = (value) => range.setAttribute("aria-valuetext", `${value} ${unit}`);
  const send = () => {
    due = performance.now() + PERIOD;
    last = null;
    ask(valueOf());
  };
  range.addEventListener("input", () => {
    number.value = valueOf();
    describe(number.value);
    clearTimeout(last);
    if (once) return;
    if (performance.now() >= due) send();
    else last = setTimeout(send, due - performance.now());
  });
  const wait = () => {
    clearTimeout(last);
    last = setTimeout(send, SETTLED);
  };
  if (once) range.addEventListener("change", wait);
  number.addEventListener("change", () => number.value !== "" && ask(Number(number.value)));
  return {
    inputs: [range, number],
    show: (value) => {
      range.value = STEPS * Math.max(0, (value - low) / (high - low)) ** (1 / power);
      number.value = Number(value.toPrecision(6));
      describe(number.value);
    },
  };
}

export function limits({ low, high }) {
  return low === null || high === null ? "" : ` (${low} to ${high})`;
}

export function element(name, given = {}) {
  return Object.assign(document.createElement(name), given);
}
