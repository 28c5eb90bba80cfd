// SPDX-License-Identifier: Apache-2.0
// An element of the page.

export function element(name, given = {}) {
  return Object.assign(document.createElement(name), given);
}
