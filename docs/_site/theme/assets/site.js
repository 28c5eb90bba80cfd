// SPDX-License-Identifier: Apache-2.0
// What scrolls in itself can be reached by keyboard.
"use strict";

document$.subscribe(() => {
  for (const part of document.querySelectorAll(".md-typeset__scrollwrap, div.arithmatex, p:has(> .arithmatex)")) {
    if (part.scrollWidth > part.clientWidth) part.tabIndex = 0;
  }
});
