// SPDX-License-Identifier: Apache-2.0
// In the place of the link to the viewer: recordings, of which the page shows what was at the time of the player.

import { byId, element, put } from "./element.js";
import { Player } from "./film_player.js";
import { Recording } from "./film_recording.js";
import { together } from "./scene.js";

const KEYS = "Space: play or pause. Arrows: one picture (Shift: half a second). Home, End: start and end. Ctrl-wheel: zoom.";
const DRAWS = 4; // of each picture: the page writes its numbers with every fourth
// In the order of the page's strips: name, label and colour of their curves.
const CHARTS = [
  [["felt", "felt", "handle"], ["motor", "motor", "force"]],
  [["given", "to the operator", "handle"], ["supplied", "to the tool", "tool"]],
  [["age", "mean", "coupling"], ["oldest", "oldest", "force"]],
  [["stretch", "stretch", "coupling"]],
];
const UNKNOWN = { name: "recording", description: "The scene was not recorded", solids: [{ name: "tool", outlines: [] }], joints: [],
  results: [], way: [], task: null, sprung: [] };

export class Link {
  constructor(onNews) {
    const recordings = JSON.parse(byId("films").textContent).map((film) => new Recording(film));
    const [first, second] = recordings;
    Object.assign(this, { onNews, recordings, recorded: true, received: 0, draws: 0 });
    if (second) align(first, second);
    this.begin = Math.min(...recordings.map((one) => one.begin));
    this.end = Math.max(...recordings.map((one) => one.end));
    byId("keys").textContent = KEYS;
    byId("facts").append(...recordings.flatMap(about));
    queueMicrotask(() => this.tell(first)); // when all that it is told to is there
  }

  tell(first) {
    this.onNews("scene", { ...(first.scene ?? UNKNOWN), room: together(this.recordings.map(({ room }) => room)) });
    this.onNews("surroundings", [first.walls, first.linkage?.workspace ?? null, first.linkage]);
    const marks = this.recordings.flatMap((one) => one.marks.map(([time, text]) => [one.shift + time, this.recordings.length > 1 ? `${one.name}: ${text}` : text]));
    const go = (time) => this.player.go(time);
    this.onNews("curves", { charts: CHARTS.map((curves) => this.chart(curves)), marks: marks.map(([time]) => time), go });
    this.player = new Player(this.begin, this.end, first.rate, (time) => {
      this.draws = DRAWS;
      this.onNews("time", time);
    });
    byId("marks").hidden = !marks.length;
    byId("marks").append(...marks.map(([time, text]) => {
      const button = element("button", { type: "button", textContent: `${signed(time)} s ${text}` });
      button.addEventListener("click", () => go(time));
      return button;
    }));
  }

  // Of the second recording, the first curve that is known.
  chart(all) {
    const [first, second] = this.recordings;
    const known = (one) => all.filter(([name]) => one?.curves[name]);
    const found = known(first).map(([name, label, colour], i) => [first, name, { label, colour, dash: i ? [5, 4] : [] }]);
    for (const [name, label] of known(second).slice(0, 1)) {
      found.push([second, name, { label: `${label}, ${second.name}`, colour: "second", dash: [8, 3, 2, 3] }]);
    }
    const count = Math.round((this.end - this.begin) * first.rate) + 1;
    const points = Array.from({ length: count }, (_, i) => {
      const time = this.begin + i / first.rate;
      return [time, ...found.map(([one, name]) => one.curve(name, time))];
    });
    return { points, curves: found.length ? found.map(([, , curve]) => curve) : [{ label: "not recorded", colour: "soft", dash: [0, 99] }] };
  }

  // The picture of the player's time, as often as the page takes to show all of it.
  next() {
    this.player?.keepUp(performance.now());
    if (!this.draws) return null;
    this.draws -= 1;
    const [first, second] = this.recordings;
    const other = second?.frame(this.player.time);
    return { ...first.frame(this.player.time), other: other?.known && { ...other, scene: second.scene } };
  }

  say() {} // nobody hears it
}

// The second is moved so that both touch something for the first time at once, or begin at once.
function align(first, second) {
  const contact = first.contact !== null && second.contact !== null;
  second.shift = contact ? first.contact - second.contact : first.begin - second.begin;
  const how = contact ? `Their first contacts are at the same time: the second is moved by ${signed(second.shift)} s.` : "Both begin at the same time.";
  byId("overlaid").append(element("i"), ` ${second.name}, on top of ${first.name}. ${how}`);
  byId("overlaid").hidden = false;
}

function signed(time) {
  return time.toFixed(2).replace("-", "−");
}

function about({ name, facts, notes }) {
  const list = element("dl");
  for (const pair of facts) list.append(...pair.map((textContent, i) => element(i ? "dd" : "dt", { textContent })));
  return [element("h2", { textContent: name }), list, ...notes.map((textContent) => element("p", { className: "note", textContent }))];
}
