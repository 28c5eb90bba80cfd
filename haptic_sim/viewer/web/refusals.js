// SPDX-License-Identifier: Apache-2.0
// A refusal goes once it is no longer true: what was refused is edited, or the connection that lacked is there.

import { byId } from "./element.js";

// Forgets the refusals that stand beside what is edited, or where its data-answer says.
export function forgetWhenEdited() {
  document.addEventListener("input", (event) => {
    const answer = byId(event.target.dataset.answer);
    if (answer) forget(answer);
    for (let place = event.target.parentElement; place; place = place.parentElement) place.querySelectorAll(":scope > .refused").forEach(forget);
  });
}

// Forgets what was answered because there was no connection.
export function forgetUnsent() {
  for (const answer of document.querySelectorAll(".answer.refused")) if (answer.textContent.startsWith("Not sent")) forget(answer);
}

function forget(answer) {
  answer.textContent = "";
  answer.classList.remove("refused");
}
