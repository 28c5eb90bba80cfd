// SPDX-License-Identifier: Apache-2.0
// Light, dark, or as the system says; what was chosen last stays. Colours that a person forces on all pages go first.

import { keep, recall } from "./memory.js";

const NEXT = { system: "light", light: "dark", dark: "system" };

// The button goes through the three; changed() is called whenever the colours are others.
export function dress(button, changed) {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const forced = matchMedia("(forced-colors: active)");
  let chosen = recall("theme") in NEXT ? recall("theme") : "system";
  const apply = () => {
    const dark = chosen === "system" ? system.matches : chosen === "dark";
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    button.setAttribute("aria-label", `Colours: ${chosen === "system" ? "as the system" : chosen}`);
    changed();
  };
  button.addEventListener("click", () => {
    chosen = NEXT[chosen];
    keep("theme", chosen);
    apply();
  });
  for (const query of [system, forced]) query.addEventListener("change", apply);
  apply();
}

// {name: colour that a canvas takes} of CSS variables: a name of the system's, such as CanvasText, is looked up.
export function colours(names) {
  const probe = document.createElement("span");
  probe.className = "probe";
  document.body.append(probe);
  const found = names.map((name) => {
    probe.style.color = `var(--${name})`;
    return [name, getComputedStyle(probe).color];
  });
  probe.remove();
  return Object.fromEntries(found);
}
