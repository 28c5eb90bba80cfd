// SPDX-License-Identifier: Apache-2.0
// Panels that fold: the title of each is a button, and what was folded or opened stays so, of lists of settings too.

import { element } from "./element.js";
import { keep, recall } from "./memory.js";

const known = read();

// Makes the panels of `place` that have a title fold, and remembers them and every <details> in it.
export function foldable(place) {
  for (const panel of place.querySelectorAll(".panel")) if (panel.querySelector("h2")) fold(panel);
  const restore = (details) => (details.open = known[nameOf(details)] ?? details.open);
  place.querySelectorAll("details").forEach(restore);
  new MutationObserver((changes) => {
    for (const { addedNodes } of changes) for (const one of addedNodes) if (one.matches?.("details")) restore(one);
  }).observe(place, { childList: true, subtree: true });
  place.addEventListener("click", ({ target }) => {
    const details = target.closest("summary")?.parentElement;
    if (details) note(nameOf(details), !details.open); // it opens or closes after this
  });
}

function fold(panel) {
  const title = panel.querySelector("h2");
  const button = element("button", { type: "button", className: "fold", textContent: title.textContent });
  title.replaceChildren(button);
  const show = (open) => {
    button.setAttribute("aria-expanded", String(open));
    panel.classList.toggle("folded", !open);
  };
  button.addEventListener("click", () => {
    const open = panel.classList.contains("folded");
    note(panel.id, open);
    show(open);
  });
  show(known[panel.id] ?? !panel.classList.contains("folded"));
}

function nameOf(details) {
  return details.id || `details ${details.querySelector("summary")?.textContent}`;
}

function note(name, open) {
  known[name] = open;
  keep("folds", JSON.stringify(known));
}

// {name: open} as noted; nothing where that is not what is kept.
function read() {
  try {
    const noted = Object.entries(JSON.parse(recall("folds")));
    return Object.fromEntries(noted.filter(([, open]) => typeof open === "boolean"));
  } catch {
    return {};
  }
}
