// SPDX-License-Identifier: Apache-2.0
// The task card: what to do in this scene, how far it is, and the hand that shows the way.

import { byId, element, put, spoken } from "./element.js";
import { say } from "./refusals.js";

const OTHERS = "Test cases";

export class TaskCard {
  // choose(name): loads a scene.
  constructor(link, choose) {
    this.link = link;
    this.scene = this.guide = null;
    this.tasks = [];
    this.reached = this.stale = false;
    byId("next_scene").addEventListener("click", () => choose(this.scene.task.next));
    byId("guide_play").addEventListener("click", () => this.ask(this.guide?.state === "playing" ? "pause" : "play"));
    byId("guide_step").addEventListener("click", () => this.ask("step"));
    byId("guide_slow").addEventListener("click", () => this.ask(this.guide?.slow ? "fast" : "slow"));
  }

  ask(act) {
    this.link.say({ do: "guide", act });
  }

  // The chooser: first the scenes that have a task, by their titles, then all others.
  welcome({ scenes, tasks }) {
    this.tasks = tasks;
    const box = byId("scene_name");
    const others = scenes.filter((name) => tasks.every((task) => task.name !== name));
    const fold = element("optgroup", { label: OTHERS });
    fold.append(...others.map((name) => option(name, spoken(name))));
    box.replaceChildren(...tasks.map(({ name, title }) => option(name, title)), fold);
  }

  setScene(scene) {
    this.scene = scene;
    this.reached = this.stale = false;
    const task = scene?.task;
    const title = byId("task_title");
    put(title.querySelector("button") ?? title, task?.title ?? spoken(scene?.name ?? "task")); // the button folds the card
    byId("goal").textContent = task?.goal ?? (scene ? `${scene.description}.` : "–");
    byId("task_hint").textContent = task?.hint ?? "";
    byId("done").textContent = "";
    byId("next_scene").hidden = true;
    byId("guide").hidden = true;
    this.rows = task ? [task.words] : (scene?.results ?? []).map((name) => `${name.replaceAll("_", " ")}: {percent} %`);
    byId("progress").replaceChildren(...this.rows.map(row));
  }

  show(frame) {
    if (!this.scene) return;
    const task = this.scene.task && progress(this.scene, frame);
    const shares = task ? [task.share] : frame.results;
    this.rows.forEach((words, i) => paint(byId("progress").children[i], words, shares[i]));
    const shows = Boolean(frame.target) && this.scene.way.length > 1; // a person's own hand cannot be led
    if (byId("guide").hidden === shows) byId("guide").hidden = !shows;
    this.stale &&= Boolean(task?.done);
    if (task?.done && !this.reached && !this.stale) this.finish();
  }

  // The scene again from its start; what is reported until then is of before.
  begin() {
    this.setScene(this.scene);
    this.stale = true;
  }

  // Once reached it stays so until the scene begins again.
  finish() {
    this.reached = true;
    const next = this.tasks.find(({ name }) => name === this.scene.task.next);
    byId("done").textContent = "Done.";
    byId("next_scene").hidden = !next;
    byId("next_scene").textContent = next ? `Next: ${next.title}` : "";
  }

  showGuide(guide) {
    if (this.guide?.state === "starting" && guide.state !== "starting") this.begin();
    this.guide = guide;
    const { state, slow } = guide;
    byId("guide_play").textContent = { playing: "Pause", paused: "Go on", starting: "Starting…" }[state] ?? "Show me";
    byId("guide_step").disabled = state === "starting";
    byId("guide_slow").setAttribute("aria-pressed", String(slow));
  }

  answered({ to, done, sentence }) {
    if (to.do === "start_scene" && done) this.begin();
    if (to.do !== "guide") return false;
    say(byId("scene_answer"), sentence, done);
    return true;
  }
}

// How far the task is: the least share of all that it asks for, NaN where that is not known, and whether all is reached.
export function progress({ task, results }, frame) {
  const asked = Object.entries(task.done).map(([name, least]) => [frame.results[results.indexOf(name)] ?? NaN, least]);
  const force = frame.felt ?? frame.force;
  const pressing = frame.contacts.length > 0; // through the air nothing is pressed
  if (task.force) asked.push([force ? pressing * (Math.hypot(force[0], force[1]) / task.force) : NaN, 1]);
  return { share: Math.min(...asked.map(([share]) => share)), done: asked.every(([share, least]) => share >= least) };
}

function row() {
  const meter = element("div", { role: "meter" });
  meter.setAttribute("aria-valuemin", "0");
  meter.setAttribute("aria-valuemax", "100");
  meter.setAttribute("aria-valuenow", "0"); // until the first frame comes, as its name
  meter.setAttribute("aria-label", "how far it is");
  meter.append(element("i"));
  const both = element("div", { className: "progress" });
  both.append(element("span"), meter);
  return both;
}

function paint(place, words, share) {
  const percent = Number.isFinite(share) ? Math.round(100 * Math.min(1, Math.max(0, share))) : null;
  const text = words.replace("{percent}", percent ?? "–");
  const [label, meter] = place.children;
  if (label.textContent === text) return;
  label.textContent = text;
  meter.setAttribute("aria-valuenow", String(percent ?? 0));
  meter.setAttribute("aria-label", text);
  meter.firstChild.style.width = `${percent ?? 0}%`;
}

function option(value, textContent) {
  return element("option", { value, textContent });
}
