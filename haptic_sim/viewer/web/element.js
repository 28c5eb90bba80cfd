// SPDX-License-Identifier: Apache-2.0
// Elements of the page: made, found, written into.

export function element(name, given = {}) {
  return Object.assign(document.createElement(name), given);
}

export function byId(id) {
  return document.getElementById(id);
}

// Writes a text, if it is another one: else it would be read out again.
export function put(place, text) {
  if (place.textContent !== text) place.textContent = text;
}
