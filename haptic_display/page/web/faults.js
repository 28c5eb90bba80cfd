// SPDX-License-Identifier: Apache-2.0
// The banner: what is wrong, why, what to do, and one button that does it. It stays until that is done.

import { element, put } from "./element.js";

const TOLD = ["title", "cause", "first"];

export class Banner {
  // press(title) is called by the button, with the title of what it shall mend.
  constructor(place, press) {
    this.place = place;
    this.button = element("button", { id: "fault_button", type: "button" });
    const words = element("div", { className: "words" });
    for (const name of [...TOLD, "elsewhere", "answer"]) { // elsewhere: on a page that has no button
      this[name] = element(name === "title" ? "h2" : "p", { id: `fault_${name}` });
      words.append(this[name]);
    }
    place.append(words, this.button);
    this.button.addEventListener("click", () => {
      this.say("Please wait: it is being done.", true);
      press(this.title.textContent);
    });
  }

  // trouble: as the viewer tells it, or null. What does not change is left alone: else it would be read out again.
  show(trouble) {
    const told = JSON.stringify(trouble);
    if (told === this.told) return;
    if (trouble?.title !== this.title.textContent) this.say("", false);
    this.told = told;
    this.place.hidden = !trouble;
    for (const name of [...TOLD, "button"]) put(this[name], trouble?.[name] ?? "");
    put(this.elsewhere, trouble?.button ? `Whoever leads presses "${trouble.button}" on their page.` : "");
    this.button.hidden = !trouble?.button;
  }

  // What came of the press: a reason why not stands here; what was done is seen, for the banner goes.
  answered({ done, sentence }) {
    this.say(done ? "" : sentence, false);
  }

  say(sentence, waiting) {
    put(this.answer, sentence);
    this.button.disabled = waiting;
  }
}
