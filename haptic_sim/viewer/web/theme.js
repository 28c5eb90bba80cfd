// SPDX-License-Identifier: Apache-2.0
// Light, dark, or as the system says.

const NEXT = { system: "light", light: "dark", dark: "system" };

// The button goes through the three; changed() is called whenever the colours are others.
export function dress(button, changed) {
  const system = matchMedia("(prefers-color-scheme: dark)");
  let chosen = "system";
  const apply = () => {
    const dark = chosen === "system" ? system.matches : chosen === "dark";
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    button.setAttribute("aria-label", `Colours: ${chosen === "system" ? "as the system" : chosen}`);
    changed();
  };
  button.addEventListener("click", () => {
    chosen = NEXT[chosen];
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
