// SPDX-License-Identifier: Apache-2.0
// The plane of the live page with the first recording, and the second as broken outlines on top.

import { path, placed } from "./pen.js";
import { SceneView } from "./scene.js";

export class FilmView extends SceneView {
  constructor(canvas, recordings) {
    super(canvas);
    [this.first, this.second] = recordings;
    this.setScene(this.first.scene);
    this.setSurroundings(this.first.walls, null);
    const rooms = recordings.map((one) => one.room);
    this.plane.room = [0, 1, 2, 3].map((side) => (side < 2 ? Math.min : Math.max)(...rooms.map((room) => room[side])));
    this.stale = true;
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
      if (!solid.fixed && pose) this.outline(context, solid, pose);
    });
    if (frame.handle) this.circle(context, frame.handle, 7 * ratio);
    context.setLineDash([]);
    if (frame.handle) this.arrow(context, this.plane.toPixels(frame.handle), frame.felt ?? [0, 0], this.ghost);
  }

  outline(context, { outlines }, pose) {
    for (const [vertices, radius] of outlines) {
      if (radius > 0) this.circle(context, placed(vertices[0], pose), radius * this.plane.scale);
      else {
        path(context, vertices.map((corner) => this.plane.toPixels(placed(corner, pose))));
        context.stroke();
      }
    }
  }

  circle(context, place, pixels) {
    context.beginPath();
    context.arc(...this.plane.toPixels(place), pixels, 0, 2 * Math.PI);
    context.stroke();
  }
}
