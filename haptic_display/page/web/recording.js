// SPDX-License-Identifier: Apache-2.0
// Recording: what the recorder does, where the bag is, and its film, which opens in a tab of its own.

import { byId, element, put } from "./element.js";
import { say } from "./refusals.js";

export class RecordingPanel {
  constructor(link) {
    this.link = link;
    this.news = { state: "no recorder", seconds: 0, bag: "", name: "", bags: [] };
    this.listed = "";
    byId("record").addEventListener("click", () => this.press());
    byId("mark").addEventListener("click", () => link.say({ do: "mark", text: byId("mark_text").value || "mark" }));
    byId("bag_path").addEventListener("focus", () => byId("bag_path").select());
    setInterval(() => this.showClock(), 250);
  }

  // Answered by the state at once; the viewer's own news follow.
  press() {
    const on = this.news.state !== "recording";
    say(byId("record_answer"), "", true);
    this.showState(on ? "starting" : "saving");
    this.link.say({ do: "record", on });
  }

  show(news) {
    this.news = news;
    this.heard = performance.now();
    this.showState(news.state);
    this.showSaved();
    this.showBags();
  }

  showState(state) {
    const button = byId("record");
    const on = state === "recording";
    button.disabled = ["no recorder", "starting", "saving"].includes(state);
    button.textContent = state === "no recorder" ? "No recorder runs" : on ? "Stop recording" : "Record";
    button.setAttribute("aria-pressed", String(on));
    put(byId("record_state"), state === "no recorder" ? "" : state);
    this.showClock();
  }

  // Minutes and seconds that it has recorded.
  showClock() {
    const { state, seconds } = this.news;
    const passed = Math.floor(seconds + (performance.now() - this.heard) / 1e3);
    put(byId("record_clock"), state === "recording" ? clock(passed) : "");
  }

  showSaved() {
    const { state, bag, name } = this.news;
    byId("saved").hidden = !bag || ["starting", "recording", "saving"].includes(state);
    if (byId("bag_path").value === bag && byId("saved").dataset.name === name) return;
    byId("bag_path").value = bag;
    byId("saved").dataset.name = name;
    byId("saved_links").replaceChildren(...(name ? [film(name)] : []));
  }

  showBags() {
    const { bags } = this.news;
    byId("earlier").hidden = !bags.length;
    const told = JSON.stringify(bags);
    if (told === this.listed) return;
    this.listed = told;
    put(byId("bag_count"), String(bags.length));
    byId("bags").replaceChildren(...bags.map(row));
  }

  answered({ to, done, sentence }) {
    if (to.do !== "mark" && to.do !== "record") return false;
    say(byId("record_answer"), to.do === "record" && done ? "" : sentence, done);
    if (!done) this.showState(this.news.state);
    return true;
  }
}

function row({ name, seconds, size }) {
  const length = seconds === null ? "not closed" : clock(Math.round(seconds));
  const item = element("li");
  item.append(element("span", { textContent: `${name}, ${length}, ${(size / 1e6).toFixed(1)} MB` }), film(name));
  return item;
}

function film(name) {
  const href = `film.html?bag=${encodeURIComponent(name)}`;
  const link = element("a", { className: "button", textContent: "Play", href, target: "_blank", rel: "noopener" });
  link.setAttribute("aria-label", `Play: ${name} (new tab)`);
  return link;
}

function clock(seconds) {
  return `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
}
