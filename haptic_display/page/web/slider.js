// SPDX-License-Identifier: Apache-2.0
// A slider over what can be felt, with what is passive as a band under it, and a field for every legal value.

import { element, put } from "./element.js";

const STEPS = 1000;
const PERIOD = 100; // ms between two values of a slider that is being drawn
const SETTLED = 600; // ms that a slider whose value is dear must have been left alone: keys move it step by step

// declared: name, kind, unit, low and high of the field; felt: [from, to] of the slider, null without one, else low to
// high; steps and even: of a slider with equal steps; else small values are finer. ask(value) while it is drawn, or,
// once: when let go.
export function slider(declared, id, ask, once = false) {
  const { name, low, high, unit, kind, steps = STEPS, even = false, felt = [low, high] } = declared;
  const number = element("input", { type: "number", min: low, max: high, step: "any", required: true });
  let last = null; // timer of what the slider has not sent yet
  number.addEventListener("change", () => {
    clearTimeout(last);
    if (number.value === "") number.reportValidity(); // the browser says that it is no number
    else ask(Number(number.value));
  });
  const showNumber = (value) => (number.value = Number(value.toPrecision(6)));
  if (!felt) {
    Object.assign(number, { id, className: "wide" });
    return { inputs: [number], show: showNumber };
  }
  const range = element("input", { type: "range", id, min: 0, max: steps });
  const band = new Band(id);
  let scale = scaleOf(felt, even);
  let due = 0;
  number.setAttribute("aria-label", `${name} as a number`);
  range.setAttribute("aria-describedby", band.text.id);
  const valueOf = () => {
    const value = Number(scale.value(range.value / steps).toPrecision(3));
    return kind === "whole" ? Math.round(value) : Math.min(high, Math.max(low, value));
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
  return {
    inputs: [range, number],
    parts: [range, number, band.track, band.text],
    // passive: [least, most]; null: no value is passive; undefined: it is not known.
    show: (value, passive) => {
      scale = scaleOf(passive ? [felt[0], Math.min(high, roundAbove(2 * passive[1]))] : felt, even);
      range.value = steps * scale.share(value);
      showNumber(value);
      describe(number.value);
      band.show(value, passive, scale, { low, high, unit });
    },
  };
}

class Band {
  constructor(id) {
    this.track = element("div", { className: "passive", hidden: true });
    this.text = element("small", { className: "passive_text", id: `${id}_passive` });
    this.bar = element("i");
    this.track.append(this.bar);
  }

  show(value, passive, scale, { low, high, unit }) {
    this.track.hidden = !passive;
    if (passive) {
      const [left, right] = passive.map((value) => scale.share(value));
      Object.assign(this.bar.style, { left: `${100 * left}%`, width: `${100 * (right - left)}%` });
    }
    const beyond = passive && (value < passive[0] || value > passive[1]);
    this.text.classList.toggle("beyond", beyond || passive === null);
    put(this.text, passive === undefined ? "" : (beyond ? "now not stable: " : "") + words(passive, low, high, unit));
  }
}

// What is passive, rounded to the passive side.
function words(passive, low, high, unit) {
  if (passive === null) return "no value is stable: lower other gains";
  const [least, most] = [rounded(passive[0], Math.ceil), rounded(passive[1], Math.floor)];
  const end = unit ? ` ${unit}` : "";
  if (passive[1] >= high && passive[0] <= low) return "stable at any value";
  if (passive[0] <= low) return `stable up to ${most}${end}`;
  return `stable from ${least} to ${most}${end}`;
}

function rounded(value, round) {
  if (value === 0) return 0;
  const unit = 10 ** (Math.floor(Math.log10(Math.abs(value))) - 2);
  return Number((round(value / unit) * unit).toPrecision(3));
}

function roundAbove(least) {
  const power = 10 ** Math.floor(Math.log10(least || 1));
  return [1, 2, 5, 10].map((factor) => factor * power).find((value) => value >= least);
}

function scaleOf([from, to], even) {
  const power = !even && (to - from > 50 || (from > 0 && to / from > 1000)) ? 3 : 1;
  return {
    value: (share) => from + (to - from) * share ** power,
    share: (value) => Math.min(1, Math.max(0, (value - from) / (to - from))) ** (1 / power),
  };
}
