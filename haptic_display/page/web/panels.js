// SPDX-License-Identifier: Apache-2.0
// Scene and exchange: what they show and what they ask for.

import { byId, element, spoken } from "./element.js";
import { say } from "./refusals.js";
import { slider } from "./slider.js";
import { limits } from "./tuning.js";

export class Panels {
  constructor(link) {
    this.link = link;
    this.select("scene_name", (name) => this.ask("scene_answer", "loading", { do: "scene", name }));
    this.select("method_name", (name) => this.ask("scene_answer", "loading", { do: "method", name }));
    byId("start_scene").addEventListener("click", () => this.ask("scene_answer", "going back", { do: "start_scene" }));
    this.offered = "";
  }

  select(id, act) {
    byId(id).addEventListener("change", () => act(byId(id).value));
  }

  ask(place, meanwhile, message) {
    say(byId(place), meanwhile, true);
    this.link.say(message);
  }

  welcome({ methods, looking }) {
    fill(byId("method_name"), methods);
    byId("looking").value = looking;
  }

  showValues({ values, offer }) {
    const simulation = values.haptic_simulation;
    for (const [id, name] of [["scene_name", "scene"], ["method_name", "method"]]) {
      const box = byId(id);
      box.disabled = !simulation;
      if (!simulation || box === document.activeElement) continue;
      const value = simulation[name].split("/").pop().replace(/\.yaml$/, "");
      const known = () => [...box.options].find((option) => [value, simulation[name]].includes(option.value));
      if (!known()) box.append(element("option", { textContent: spoken(value), value: simulation[name] }));
      box.value = known().value;
    }
    this.showOffer(offer, values);
  }

  showOffer(offer, values) {
    const names = Object.keys(offer).join();
    if (names !== this.names || !names) this.buildOffer(offer, values.haptic_driver?.["exchange.method"] ?? "–");
    const told = JSON.stringify(offer);
    if (told !== this.offered) for (const [name, { value }] of Object.entries(offer)) this.offers[name](value);
    this.names = names;
    this.offered = told;
  }

  buildOffer(offer, method) {
    this.offers = {};
    const rows = Object.entries(offer).map(([name, one]) => this.offerRow(name, one));
    const note = rows.length ? "A change starts the nodes again; the hand begins where the scene does."
      : `Method ${method}. It and a delay are fixed once the nodes run; haptic demo --view starts them again for it.`;
    byId("offers").replaceChildren(...rows, element("p", { className: "note", textContent: note }));
  }

  offerRow(name, offered) {
    const id = `offer_${name.replaceAll(".", "_")}`;
    const change = (value) => this.ask("restart_answer", "the nodes start again", { do: "restart", name, value });
    const label = element("label", { htmlFor: id, textContent: offered.unit ? `${name} [${offered.unit}]` : name });
    const row = element("div", { className: offered.choices ? "row" : "tuned" });
    if (offered.choices) {
      const input = element("select", { id });
      fill(input, offered.choices);
      input.addEventListener("change", () => change(input.value));
      this.offers[name] = (value) => (input.value = value);
      row.append(label, input);
    } else {
      const { parts, show } = slider({ ...offered, name, kind: "number" }, id, change, true);
      label.append(element("small", { textContent: limits(offered) }));
      this.offers[name] = show;
      row.append(label, ...parts);
    }
    return row;
  }

  answered({ to, done, sentence }) {
    const place = { scene: "scene_answer", method: "scene_answer", start_scene: "scene_answer",
      restart: "restart_answer" }[to.do];
    if (place) say(byId(place), sentence.replace(/(?<=^scene is )\w+$/, titled), done);
    if (to.do === "restart" && !done) this.offered = ""; // back to how it is
    return Boolean(place);
  }
}

// mm, or null where handle or tool are not known.
export function stretch({ handle, tool }) {
  return handle && tool ? 1e3 * Math.hypot(tool[0] - handle[0], tool[1] - handle[1]) : null;
}

// A number with so many digits after its point; what is not known is a dash.
export function shown(number, digits) {
  return Number.isFinite(number) ? (Math.round(10 ** digits * number) / 10 ** digits + 0).toFixed(digits) : "–";
}

// The title of a scene that the page offers.
function titled(name) {
  return [...byId("scene_name").options].find(({ value }) => value === name)?.text ?? spoken(name);
}

function fill(box, names) {
  box.replaceChildren(...names.map((name) => element("option", { textContent: name.replaceAll("_", " "), value: name })));
}
