// SPDX-License-Identifier: Apache-2.0
// The banner: what is wrong, why, what to do, and one button that does it. It stays until that is done.

import { element, put } from "./element.js";

export class Banner {
  // press(title) is called by the button, with the title of what it shall mend.
  constructor(place, press) {
    this.place = place;
    this.title = element("h2", { id: "fault_title" });
    this.cause = element("p", { id: "fault_cause" });
    this.first = element("p", { id: "fault_first" });
    this.button = element("button", { id: "fault_button", type: "button" });
    this.elsewhere = element("p", { id: "fault_elsewhere" }); // on a page that has no button
    this.answer = element("p", { id: "fault_answer" });
    const words = element("div", { className: "words" });
    words.append(this.title, this.cause, this.first, this.elsewhere, this.answer);
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
    put(this.title, trouble?.title ?? "");
    put(this.cause, trouble?.cause ?? "");
    put(this.first, trouble?.first ?? "");
    put(this.elsewhere, trouble?.button ? `Whoever leads presses "${trouble.button}" on their page.` : "");
    put(this.button, trouble?.button ?? "");
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
