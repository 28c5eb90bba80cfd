// SPDX-License-Identifier: Apache-2.0
// The state in the page's title: a page in the background shows it too.

export function entitled(state) {
  const name = document.title;
  const show = () => (document.title = `${state.textContent} — ${name}`);
  new MutationObserver(show).observe(state, { childList: true, characterData: true, subtree: true });
  show();
}
