// SPDX-License-Identifier: Apache-2.0
// What a person chose on this page, kept by the browser; a browser that keeps nothing forgets it with the page.

// What was kept under this name, or nothing.
export function recall(name) {
  try {
    return localStorage.getItem(name);
  } catch {
    return null;
  }
}

export function keep(name, text) {
  try {
    localStorage.setItem(name, text);
  } catch {
    // it holds for as long as the page is open
  }
}
