// SPDX-License-Identifier: Apache-2.0
// Puts the page of a film together: one time, which the player moves, and what is shown at it.

import { Player } from "./film_player.js";
import { Plots } from "./film_plots.js";
import { Recording } from "./film_recording.js";
import { FilmView } from "./film_view.js";

const byId = (id) => document.getElementById(id);
const recordings = JSON.parse(byId("films").textContent).map((film) => new Recording(film));
const [first, second] = recordings;
if (second) align();

const view = new FilmView(byId("scene"), recordings);
const begin = Math.min(...recordings.map((one) => one.begin));
const end = Math.max(...recordings.map((one) => one.end));
const plots = new Plots(recordings, begin, end, (time) => player.go(time));
let due = begin;
const player = new Player(begin, end, first.rate, (time) => (due = time));

const system = matchMedia("(prefers-color-scheme: dark)");
system.addEventListener("change", dress);
dress();
describe();
requestAnimationFrame(draw);

function dress() {
  document.documentElement.dataset.theme = system.matches ? "dark" : "light";
  view.recolour();
  plots.recolour();
}

function draw(now) {
  requestAnimationFrame(draw);
  player.keepUp(now);
  view.show(due);
  plots.show(due);
  for (const [id, curve, unit] of [["force", first.curves.felt ? "felt" : "motor", "N"], ["stretch", "stretch", "mm"], ["given", "given", "mJ"], ["age", "age", "ms"]]) {
    const number = first.curve(curve, due);
    const text = number === null ? "–" : `${number.toFixed(2)} ${unit}`.replace("-", "−");
    if (byId(id).textContent !== text) byId(id).textContent = text;
  }
}

// The second film is moved so that both touch something for the first time at once, or begin at once.
function align() {
  const contact = first.contact !== null && second.contact !== null;
  second.shift = contact ? first.contact - second.contact : first.begin - second.begin;
  const moved = second.shift.toFixed(2).replace("-", "−");
  const how = contact ? `Their first contacts are at the same time: the second is moved by ${moved} s.` : "Both begin at the same time.";
  byId("overlaid").append(document.createElement("i"), ` ${second.name}, on top of ${first.name}. ${how}`);
  byId("overlaid").hidden = false;
}

function describe() {
  byId("date").textContent = recordings.map((one) => one.date).join(" and ");
  for (const one of recordings) byId("about").append(...about(one));
  const marks = recordings.flatMap((one) => one.marks.map(([time, text]) => [one.shift + time, recordings.length > 1 ? `${one.name}: ${text}` : text]));
  byId("marks").hidden = !marks.length;
  byId("marks").append(element("span", "Marks:"), ...marks.map(([time, text]) => {
    const button = element("button", `${time.toFixed(2).replace("-", "−")} s ${text}`);
    button.type = "button";
    button.addEventListener("click", () => player.go(time));
    return button;
  }));
}

function about({ name, facts, notes }) {
  const list = element("dl");
  for (const [label, value] of facts) list.append(element("dt", label), element("dd", value));
  return [element("h2", name), list, ...notes.map((note) => Object.assign(element("p", note), { className: "note" }))];
}

function element(kind, text = "") {
  return Object.assign(document.createElement(kind), { textContent: text });
}
