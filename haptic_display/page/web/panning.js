// SPDX-License-Identifier: Apache-2.0
// What moves the view and not the hand: the middle or right button, Shift-drag, two fingers, Ctrl-wheel, Ctrl-arrows.

const STRIDE = 60; // CSS pixels for an arrow key
const WAYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export function panned(view) {
  const { canvas } = view;
  const fingers = new Map(); // pointers that move the view, and where they are
  let first = null; // a finger that leads the hand until a second one comes
  const take = (event) => {
    event.stopImmediatePropagation();
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  };
  listen(canvas, "pointerdown", (event) => {
    if (event.pointerType === "touch" && first && !fingers.size) {
      canvas.dispatchEvent(new PointerEvent("pointercancel", { pointerId: first.id })); // the hand lets go
      fingers.set(first.id, first.at);
    }
    if (fingers.size || event.button > 0 || event.shiftKey) take(event);
    else if (event.pointerType === "touch") first = { id: event.pointerId, at: [event.clientX, event.clientY] };
  });
  listen(canvas, "pointermove", (event) => {
    if (first?.id === event.pointerId) first.at = [event.clientX, event.clientY];
    if (!fingers.has(event.pointerId)) return;
    event.stopImmediatePropagation();
    const before = around([...fingers.values()], canvas);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const now = around([...fingers.values()], canvas);
    view.pan(now.middle[0] - before.middle[0], now.middle[1] - before.middle[1]);
    if (before.wide > 0) view.zoom(now.wide / before.wide, now.middle);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    listen(canvas, name, (event) => {
      if (event.isTrusted && first?.id === event.pointerId) first = null;
      if (event.isTrusted && fingers.delete(event.pointerId)) event.stopImmediatePropagation();
    });
  }
  listen(canvas, "wheel", (event) => {
    if (!event.ctrlKey) return; // also what a touchpad makes of two fingers
    event.preventDefault();
    event.stopImmediatePropagation();
    view.zoom(Math.exp(-event.deltaY / 300), inside(canvas, [event.clientX, event.clientY]));
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("keydown", (event) => {
    if (!event.ctrlKey || !(event.key in WAYS)) return;
    event.preventDefault();
    view.pan(...WAYS[event.key].map((way) => way * STRIDE));
  });
}

// Ahead of whoever else listens.
function listen(canvas, name, act) {
  canvas.addEventListener(name, act, { capture: true, passive: false });
}

// Middle of the fingers, on the canvas, and how far the first two are apart; 0 for one.
function around(places, canvas) {
  const middle = [0, 1].map((i) => places.reduce((sum, place) => sum + place[i], 0) / places.length);
  const wide = places.length > 1 ? Math.hypot(places[0][0] - places[1][0], places[0][1] - places[1][1]) : 0;
  return { middle: inside(canvas, middle), wide };
}

function inside(canvas, [x, y]) {
  const box = canvas.getBoundingClientRect();
  return [x - box.left, y - box.top];
}
