// SPDX-License-Identifier: Apache-2.0
// States, faults, lateness and the passivity margin, from the nodes' diagnostics.

import { element, put } from "./element.js";

const LEVELS = { idle: "warn", "waiting for a small force": "warn", engaging: "warn", engaged: "good", fault: "bad" };
const FIGURES = [
  ["servo late p50 / p99", "µs", (d) => `${round(d.lateness_us_p50)} / ${round(d.lateness_us_p99)}`],
  ["servo late p99.9 / most", "µs", (d) => `${round(d.lateness_us_p999)} / ${round(d.lateness_us_max)}`],
  ["tool's age p50 / p99", "ms", (d) => `${round(d.age_ms_p50)} / ${round(d.age_ms_p99)}`],
  ["the above, of the last", "s", (d) => round(d.window_s)],
  ["ticks missed", "", (d) => `${d.missed} of ${d.ticks}`],
  ["exchange", "", (d) => d.exchange_method],
  ["samples answered", "", (d) => `${d.exchange_answered} of ${d.exchange_sent}`],
];
const NOBODY = "Please wait: no node is heard of yet. If that stays so, start the nodes in a terminal.";

export function driverOf(status) {
  return status?.nodes.haptic_driver ?? null;
}

export function showHealth(status, tuning) {
  const driver = driverOf(status);
  showState(driver, status);
  showProblem(status);
  const rows = driver ? FIGURES.map(([name, unit, of]) => row(name, `${of(driver.values)} ${unit}`)) : [];
  document.querySelector("#figures tbody").replaceChildren(...rows);
  document.getElementById("nodes").replaceChildren(...worthSaying(status.nodes).map(([name, node]) => {
    const item = element("li", { textContent: `${name}: ${node.message}` });
    item.dataset.level = node.level;
    return item;
  }));
  const length = Number(driver?.values.window_s);
  document.getElementById("age_window").textContent = length ? `, of the last ${round(length)} s` : "";
  showMargins(driver, tuning?.damping ?? []);
}

// Every node; of the figures that diagnostics watch (`node: figure`) those that are beyond a limit.
function worthSaying(statuses) {
  return Object.entries(statuses).filter(([name, { level }]) => level > 0 || !name.includes(": ")).sort();
}

function showState(driver, { trouble, unfelt }) {
  const chip = document.getElementById("state");
  const state = driver ? driver.values.state : "no driver";
  const weak = unfelt.words && LEVELS[state] === "good";
  put(chip, trouble?.fault ? `fault: ${trouble.title}` : weak ? `${state}: ${unfelt.words}` : state);
  chip.dataset.level = weak ? "warn" : LEVELS[state] ?? "bad";
  const told = document.getElementById("withheld");
  put(told, unfelt.todo);
  told.hidden = !unfelt.todo;
}

function showProblem(status) {
  const banner = document.getElementById("banner");
  if (document.body.classList.contains("lost")) return;
  const silent = Object.keys(status.nodes).length === 0 && !status.trouble ? NOBODY : "";
  put(banner, status.problem || silent);
  banner.hidden = !banner.textContent;
}

function showMargins(driver, damping) {
  const there = Math.min(...damping.slice(0, 2));
  showMargin("margin", Number(driver?.values.passivity_margin), there, "N s/m");
  const turns = damping.length > 2;
  document.getElementById("margin_theta_row").hidden = !turns;
  if (turns) showMargin("margin_theta", Number(driver?.values.passivity_margin_theta), damping[2], "N m s/rad");
}

function showMargin(id, left, there, unit) {
  const gauge = document.getElementById(id);
  const known = Number.isFinite(left) && Number.isFinite(there);
  const share = known ? Math.min(1, Math.max(0, left / there)) : 0;
  gauge.setAttribute("aria-valuemax", known ? there : 1);
  gauge.setAttribute("aria-valuenow", known ? Math.max(0, left) : 0);
  gauge.setAttribute("aria-valuetext", known ? `${left} of ${there} ${unit} left` : "not known");
  gauge.classList.toggle("low", share < 0.1);
  gauge.firstElementChild.style.width = `${100 * share}%`;
  document.getElementById(`${id}_text`).textContent = known ? `${round(left)} ${unit}` : "–";
}

function row(name, value) {
  const made = element("tr");
  made.append(element("th", { textContent: name, scope: "row" }), element("td", { textContent: value }));
  return made;
}

function round(text) {
  const value = Number(text);
  return Number.isFinite(value) ? String(Number(value.toPrecision(3))) : "–";
}
