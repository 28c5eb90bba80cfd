// SPDX-License-Identifier: Apache-2.0
// Answers beside what was asked for. A refusal is brought into view, and goes once it is no longer true: what was
// refused is edited, or the connection that lacked is there.

// Writes a sentence into the element of an answer.
export function say(answer, sentence, done) {
  answer.textContent = sentence;
  answer.classList.toggle("refused", !done);
  if (done || !sentence) return;
  const [panel, list] = [answer.closest(".folded"), answer.closest("details")];
  panel?.querySelector(".fold").click();
  if (list) list.open = true;
  answer.scrollIntoView({ block: "nearest" });
}

// Forgets the refusals that stand beside what is edited.
export function forgetWhenEdited() {
  document.addEventListener("input", (event) => {
    for (let place = event.target.parentElement; place; place = place.parentElement) place.querySelectorAll(":scope > .refused").forEach(forget);
  });
}

// Forgets what was answered because there was no connection.
export function forgetUnsent() {
  for (const answer of document.querySelectorAll(".answer.refused")) if (answer.textContent.startsWith("Not sent")) forget(answer);
}

function forget(answer) {
  say(answer, "", true);
}
