// SPDX-License-Identifier: Apache-2.0
// The plane of the live page with the first recording, and the second as broken outlines on top.

import { outline } from "./pen.js";
import { SceneView, together } from "./scene.js";

export class FilmView extends SceneView {
  constructor(canvas, recordings) {
    super(canvas);
    [this.first, this.second] = recordings;
    this.setScene(this.first.scene);
    this.setSurroundings(this.first.walls, null);
    this.look(together(recordings.map((one) => one.room)));
  }

  recolour() {
    super.recolour();
    this.ghost = getComputedStyle(document.documentElement).getPropertyValue("--second").trim();
    this.drawn = null;
  }

  show(time) {
    const resized = this.plane.resize();
    if (resized) this.stale = true;
    if (this.drawn === time && !this.stale) return;
    this.drawn = time;
    const nothing = { handle: null, tool: null, bodies: [], contacts: [] };
    this.draw(this.first.frame(time) ?? nothing);
    const frame = this.second?.frame(time);
    if (frame) this.paintGhost(this.canvas.getContext("2d"), frame);
  }

  paintGhost(context, frame) {
    const { ratio } = this.plane;
    context.strokeStyle = this.ghost;
    context.lineWidth = 2 * ratio;
    context.setLineDash([6 * ratio, 4 * ratio]);
    (this.second.scene?.solids ?? []).forEach((solid, i) => {
      const pose = i ? frame.bodies[i - 1] : frame.tool;
      if (!solid.fixed && pose) outline(context, this.plane, solid.outlines, pose);
    });
    if (frame.handle) outline(context, this.plane, [[[[0, 0]], (7 * ratio) / this.plane.scale]], frame.handle);
    context.setLineDash([]);
    if (frame.handle) this.arrow(context, this.plane.toPixels(frame.handle), frame.felt ?? [0, 0], this.ghost);
  }
}
