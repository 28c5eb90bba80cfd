// SPDX-License-Identifier: Apache-2.0
// Two layers: what everybody needs, and, on demand, what experts look at. What was chosen last stays.

import { keep, recall } from "./memory.js";

// Makes the button switch what carries data-layer="expert" on and off.
export function layered(button) {
  const show = (expert) => {
    document.body.classList.toggle("expert", expert);
    button.setAttribute("aria-pressed", String(expert));
  };
  button.addEventListener("click", () => {
    const expert = !document.body.classList.contains("expert");
    keep("layer", expert ? "expert" : "simple");
    show(expert);
  });
  show(recall("layer") === "expert");
}
