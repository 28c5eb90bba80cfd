// SPDX-License-Identifier: Apache-2.0
// Elements of the page: made, found, written into.

export function element(name, given = {}) {
  return Object.assign(document.createElement(name), given);
}

export function byId(id) {
  return document.getElementById(id);
}

// The name of a scene as people say it.
export function spoken(name) {
  return name[0].toUpperCase() + name.slice(1).replaceAll("_", " ");
}

// Writes a text, if it is another one: else it would be read out again.
export function put(place, text) {
  if (place.textContent !== text) place.textContent = text;
}
