// SPDX-License-Identifier: Apache-2.0
// Puts the page together: what comes from the viewer goes to the parts that show it, what people do goes back.

import { explain } from "./about.js";
import { byId, element, put } from "./element.js";
import { Banner } from "./faults.js";
import { foldable } from "./folds.js";
import { Hand, turning } from "./hand.js";
import { driverOf, showHealth } from "./health.js";
import { History } from "./history.js";
import { layered } from "./layer.js";
import { Link } from "./link.js";
import { Panels, shown, stretch } from "./panels.js";
import { panned } from "./panning.js";
import { loading } from "./presets.js";
import { RecordingPanel } from "./recording.js";
import { forgetUnsent, forgetWhenEdited, say } from "./refusals.js";
import { SceneView } from "./scene.js";
import { Strips } from "./strips.js";
import { TaskCard } from "./task.js";
import { dress } from "./theme.js";
import { entitled } from "./title.js";
import { Tone } from "./tone.js";
import { Tuning } from "./tuning.js";
import { WallDots } from "./wall_dots.js";
import { Walls } from "./walls.js";

const HINT = 3000; // ms that a hint stays
const BY_TOUCH = "Drag: lead the hand until you let go. Hold: it stays. Two fingers: move the view and zoom.";
const ALL_FELT = { words: "", todo: "" };
const NO_GUIDE = { state: "off", share: 0, slow: false };

let status = null;
let tuningNews = null;
let control = false;
let hintTimer = null;
let count = 0;

const view = new SceneView(byId("scene"));
const link = new Link(take, connected);
const history = new History((values) => link.say({ do: "set_all", values }), {
  undo: byId("undo"), redo: byId("redo"), defaults: byId("defaults"),
});
const set = (values, thing) => history.ask(values, thing);
const gains = new Tuning(byId("gains"), set, {
  "coupling.stiffness": "How stiff the tool is held",
  "coupling.damping": "How damped",
});
const tuning = new Tuning(byId("sliders"), set);
const walls = new Walls(view, set);
const dots = new WallDots(byId("wall_dots"), view, walls);
const panels = new Panels(link);
const fault = new Banner(byId("fault"), (title) => link.say({ do: "mend", title }));
const recording = new RecordingPanel(link);
const tone = new Tone(byId("tone"));
const task = new TaskCard(link, (name) => panels.ask("scene_answer", "loading", { do: "scene", name }));
panned(view); // before the hand, which is not led by what moves the view
const hand = new Hand(view, byId("hold"), lead, () => link.say({ do: "let_go" }));
const strips = new Strips([
  [byId("strip_force"), [{ label: "motor", colour: "force" }, { label: "felt", colour: "handle", dash: [5, 4] }], 1],
  [byId("strip_energy"), [{ label: "hand", colour: "handle" }, { label: "tool", colour: "tool", dash: [5, 4] }], 1],
  [byId("strip_age"), [{ label: "median", colour: "coupling" }, { label: "99 %", colour: "force", dash: [5, 4] }], 2],
  [byId("strip_stretch"), [{ label: "stretch", colour: "coupling" }], 1],
], { pause: byId("pause"), closer: byId("closer"), wider: byId("wider") });

loading(byId("load"), byId("load_file"), () => history.keepAll(), (sentence, done) => say(byId("tuning_answer"), sentence, done));
layered(byId("layer"));
forgetWhenEdited();
entitled(byId("state"));
foldable(document.querySelector("aside"));
if (matchMedia("(hover: none)").matches && !link.recorded) byId("keys").textContent = BY_TOUCH;
explain(byId("explained"), byId("about"), byId("keys"));
dress(byId("theme"), () => [view, ...strips.strips].forEach((part) => part.recolour()));
turning(byId("turn_left"), hand, 1);
turning(byId("turn_right"), hand, -1);
byId("take_over").addEventListener("click", () => link.say({ do: "take_over" }));
byId("zoom_in").addEventListener("click", () => view.zoom(1.4));
byId("zoom_out").addEventListener("click", () => view.zoom(1 / 1.4));
byId("fit").addEventListener("click", () => view.fit());
for (const button of document.querySelectorAll("[data-service]")) {
  // Pressed is enough: an e-stop does not wait for the button to be let go.
  const act = () => link.say({ do: "trigger", service: button.dataset.service });
  if (button.id !== "estop") button.addEventListener("click", act);
  else for (const name of ["pointerdown", "click"]) button.addEventListener(name, act);
}
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") link.say({ do: "trigger", service: "estop" });
});
requestAnimationFrame(draw);
setInterval(showRates, 1000);

function take(kind, content) {
  if (kind === "hello") welcome(content);
  else if (kind === "scene") showScene(content);
  else if (kind === "values") showValues(content);
  else if (kind === "status") showStatus(content);
  else if (kind === "leader") showLeader(content);
  else if (kind === "recordings") recording.show(content);
  else if (kind === "hint") hint(content);
  else if (kind === "surroundings") view.setSurroundings(...content);
  else if (kind === "curves") strips.show(content);
  else if (kind === "time") strips.point(content);
  else if (kind === "answer") answered(content);
}

function showScene(scene) {
  view.setScene(scene);
  task.setScene(scene);
}

function welcome(news) {
  control = news.control;
  document.body.classList.toggle("looking", !control);
  if (!control) byId("about").dataset.otherwise = byId("keys").textContent = "This page is view-only. Esc: e-stop.";
  for (const part of [gains, tuning, walls]) part.build(news.declarations);
  panels.welcome(news);
  task.welcome(news);
}

function showValues(news) {
  tuningNews = news;
  const driver = news.values.haptic_driver ?? {};
  history.show(driver, news.began);
  for (const part of [gains, tuning]) part.show(driver, news.passive);
  walls.show(news);
  panels.showValues(news);
}

function showStatus(news) {
  status = { trouble: null, unfelt: ALL_FELT, guide: NO_GUIDE, ...news };
  showHealth(status, tuningNews);
  fault.show(status.trouble);
  view.unfelt = status.unfelt.words;
  task.showGuide(status.guide);
}

function showLeader(who) {
  hand.ledBy(who);
  byId("leader").hidden = who !== "other" || !control;
}

function answered(answer) {
  if (task.answered(answer) || panels.answered(answer) || recording.answered(answer)) return;
  if (answer.to.do === "mend") fault.answered(answer);
  else if (answer.to.do === "set_all") settled(answer);
  else if (!answer.done || answer.to.service === "estop") hint(answer.sentence);
}

// The answer to a wish for values: where they are shown, or below them all.
function settled(answer) {
  history.answered(answer.to.values);
  const heard = [gains, tuning, walls].map((part) => part.answered(answer)).some(Boolean);
  say(byId("tuning_answer"), heard || answer.done ? "" : answer.sentence, answer.done);
}

function connected(open, sentence) {
  const banner = byId("banner");
  document.body.classList.toggle("lost", !open);
  put(banner, sentence);
  banner.hidden = open;
  if (open) {
    forgetUnsent();
    fault.say("", false); // what was asked for before is answered to nobody
  } else {
    byId("state").textContent = "no viewer";
    byId("state").dataset.level = "bad";
  }
}

function lead(place) {
  if (!control) hint("This page is view-only.");
  else if (place === null) hint(without());
  else link.say({ do: "aim", ...place });
}

// Why there is no hand to lead: the driver has a real device, or nothing runs yet.
function without() {
  const real = driverOf(status) && !status.nodes.haptic_loopback;
  return real ? "This is a real device: move its handle yourself." : "There is no hand to lead yet.";
}

function hint(sentence) {
  byId("hint").textContent = sentence;
  clearTimeout(hintTimer);
  hintTimer = setTimeout(() => (byId("hint").textContent = ""), HINT);
}

function draw() {
  requestAnimationFrame(draw);
  dots.follow();
  const frame = link.next();
  if (!frame) {
    view.keepUp();
    return;
  }
  view.draw(frame);
  record(frame);
  count += 1;
  if (count % 4 === 0) showNumbers(frame); // quicker than that nobody reads
  if (count % 3 === 0 && !link.recorded) strips.strips[(count / 3) % 3].draw();
}

function record(frame) {
  const driver = driverOf(status)?.values;
  const size = (force) => (force ? Math.hypot(force[0], force[1]) : null);
  strips.push(frame.time, [
    [size(frame.force), size(frame.felt)],
    frame.energy.map((joule) => (joule === null ? null : 1e3 * joule)),
    driver ? [Number(driver.age_ms_p50), Number(driver.age_ms_p99)] : [null, null],
    [stretch(frame)],
  ]);
  tone.set(size(frame.felt ?? frame.force) ?? 0);
}

function showNumbers(frame) {
  const force = frame.felt ?? frame.force;
  put(byId("force"), withUnit(force && Math.hypot(force[0], force[1]), 2, "N"));
  put(byId("torque"), withUnit(force && force[2], 3, "N m"));
  put(byId("stretch"), withUnit(stretch(frame), 2, "mm"));
  task.show(frame);
  const names = view.scene?.results ?? [];
  const place = byId("results");
  if (place.childElementCount !== names.length || place.dataset.names !== names.join()) build(place, names);
  names.forEach((name, i) => put(byId(`result_${name}`), shown(frame.results[i], 3)));
}

function withUnit(number, digits, unit) {
  const text = shown(number, digits);
  return text === "–" ? text : `${text} ${unit}`;
}

function build(place, names) {
  place.dataset.names = names.join();
  place.replaceChildren(...names.map((name) => {
    const pair = element("div");
    pair.append(element("dt", { textContent: name.replaceAll("_", " ") }), element("dd", { id: `result_${name}` }));
    return pair;
  }));
}

let drawnBefore = 0;
let receivedBefore = 0;

function showRates() {
  const own = status?.viewer;
  const drawn = count - drawnBefore;
  const received = link.received - receivedBefore;
  drawnBefore = count;
  receivedBefore = link.received;
  Object.assign(document.documentElement.dataset, { drawn, received, cpu: own?.cpu ?? "", tone: tone.gain ?? "" });
  put(byId("rates"), `${received} frames/s received, ${drawn} drawn; viewer takes ${own ? Math.round(100 * own.cpu) : "–"} % of a core, ${own?.pages ?? 0} pages`);
}
