// SPDX-License-Identifier: Apache-2.0
// Draws the scene: what stands still is painted once on a layer of its own, what moves with every frame.

import { paintWay } from "./ghost.js";
import { line, nearest, path, placed, zigzag } from "./pen.js";
import { Plane } from "./plane.js";
import { colours } from "./theme.js";

const PIXELS_PER_NEWTON = 6;
const LONGEST_ARROW = 140;
const COLOURS = ["ground", "panel", "ink", "soft", "line", "grid", "handle", "tool", "fixed", "moving", "coupling",
  "force", "contact", "target"];

export class SceneView {
  constructor(canvas) {
    this.canvas = canvas;
    this.plane = new Plane(canvas);
    this.still = document.createElement("canvas");
    this.scene = this.frame = null;
    this.walls = [];
    this.workspace = null;
    this.unfelt = ""; // why the tool is not felt
    this.lastTool = null; // where it was, of a simulation that fell silent
    this.recolour();
  }

  recolour() {
    this.colours = colours(COLOURS);
    this.stale = true;
  }

  setScene(scene) {
    this.scene = scene;
    this.lastTool = null;
    this.fit();
  }

  setSurroundings(walls, workspace) {
    const told = JSON.stringify([walls, workspace]);
    if (told === this.told) return;
    this.told = told;
    this.walls = walls;
    this.workspace = workspace;
    this.stale = true;
    if (!this.scene) this.fit();
  }

  fit() {
    const [x, y] = this.workspace || [];
    if (this.scene) this.plane.room = this.scene.room;
    else if (x) this.plane.room = [x[0], y ? y[0] : -0.05, x[1], y ? y[1] : 0.05];
    this.plane.fit();
    this.stale = true;
  }

  // about: a point of the page that stays where it is; the middle unless given.
  zoom(factor, about) {
    this.plane.zoomBy(factor, about);
    this.stale = true;
  }

  // By pixels of the page, to the right and down.
  pan(x, y) {
    this.plane.pan(x, y);
    this.stale = true;
  }

  draw(frame) {
    if (this.plane.resize() || this.stale) this.paintStill();
    const context = this.canvas.getContext("2d", { alpha: false });
    context.drawImage(this.still, 0, 0);
    this.frame = frame;
    if (!frame) return;
    this.paintMoving(context, frame);
    if (frame.handle && frame.tool) this.paintCoupling(context, frame);
    for (const contact of frame.contacts) this.paintContact(context, contact);
    if (frame.target) this.paintTarget(context, frame.target);
    if (frame.handle) this.paintHandle(context, frame);
  }

  // The last frame again, where the canvas or its colours have changed and no new one comes.
  keepUp() {
    if (this.plane.resize()) this.stale = true;
    if (this.stale) this.draw(this.frame);
  }

  paintStill() {
    this.stale = false;
    this.still.width = this.canvas.width;
    this.still.height = this.canvas.height;
    const context = this.still.getContext("2d", { alpha: false });
    context.fillStyle = this.colours.ground;
    context.fillRect(0, 0, this.still.width, this.still.height);
    this.plane.drawAxes(context, this.colours);
    this.paintWorkspace(context);
    for (const wall of this.walls) this.paintWall(context, wall);
    for (const solid of this.scene?.solids ?? []) {
      if (solid.fixed) this.paintSolid(context, solid, solid.pose, this.colours.fixed, 1);
    }
    if (this.scene?.task) paintWay(context, this.plane, this.scene, this.colours.soft);
  }

  paintWorkspace(context) {
    if (!this.workspace) return;
    const [x, y] = [this.workspace[0], this.workspace[1] ?? [-0.01, 0.01]];
    const [left, top] = this.plane.toPixels([x[0], y[1]]);
    const [right, bottom] = this.plane.toPixels([x[1], y[0]]);
    context.strokeStyle = this.colours.soft;
    context.lineWidth = 1.5 * this.plane.ratio;
    context.setLineDash([8, 6]);
    context.strokeRect(left, top, right - left, bottom - top);
    context.setLineDash([]);
  }

  paintWall(context, [nx, ny, offset]) {
    const far = 2;
    const foot = [nx * offset, ny * offset];
    const ends = [far, -far].map((t) => this.plane.toPixels([foot[0] - ny * t, foot[1] + nx * t]));
    const back = [-far, far].map((t) => this.plane.toPixels([foot[0] - ny * t - nx, foot[1] + nx * t - ny]));
    context.globalAlpha = 0.25;
    context.fillStyle = this.colours.handle;
    path(context, [...ends, ...back]);
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = this.colours.handle;
    context.lineWidth = 2 * this.plane.ratio;
    line(context, ...ends[0], ...ends[1]);
  }

  paintMoving(context, frame) {
    this.lastTool = frame.tool ?? this.lastTool;
    if (!this.scene || !this.lastTool) return;
    const [tool, ...bodies] = this.scene.solids;
    bodies.forEach((solid, i) => {
      if (!solid.fixed && frame.bodies[i]) this.paintSolid(context, solid, frame.bodies[i], this.colours.moving, 0.9);
    });
    this.paintGrip(context, tool, this.lastTool);
    this.paintTool(context, tool, frame.tool ? this.unfelt : "simulation silent");
    this.paintJoints(context, frame);
  }

  // One that is not felt is faded, with a broken outline and the reason.
  paintTool(context, tool, unfelt) {
    this.canvas.dataset.unfelt = unfelt;
    context.setLineDash(unfelt ? [4 * this.plane.ratio, 4 * this.plane.ratio] : []);
    this.paintSolid(context, tool, this.lastTool, this.colours.tool, unfelt ? 0.3 : 0.85);
    context.setLineDash([]);
    if (!unfelt) return;
    const [x, y] = this.plane.toPixels(this.lastTool);
    context.font = `600 ${13 * this.plane.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    context.textAlign = "left";
    context.fillStyle = this.colours.ink;
    context.fillText(unfelt, x + 16 * this.plane.ratio, y - 16 * this.plane.ratio);
  }

  // From the tool's grip, where the coupling holds it, to its nearest shape, if it does not lie in one.
  paintGrip(context, { outlines }, pose) {
    const end = nearest(outlines);
    if (!end) return;
    context.strokeStyle = this.colours.ink;
    context.lineWidth = 2 * this.plane.ratio;
    line(context, ...this.plane.toPixels(pose), ...this.plane.toPixels(placed(end, pose)));
  }

  paintSolid(context, solid, pose, colour, alpha) {
    context.globalAlpha = alpha;
    context.fillStyle = colour;
    context.strokeStyle = this.colours.ink;
    context.lineWidth = this.plane.ratio;
    for (const outline of solid.outlines) {
      this.trace(context, outline, pose);
      context.fill();
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  trace(context, [vertices, radius], pose) {
    const corners = vertices.map((corner) => this.plane.toPixels(placed(corner, pose)));
    if (radius > 0) {
      context.beginPath();
      context.arc(...corners[0], radius * this.plane.scale, 0, 2 * Math.PI);
      const [x, y] = vertices[0];
      context.moveTo(...corners[0]);
      context.lineTo(...this.plane.toPixels(placed([x + radius, y], pose)));
    } else {
      path(context, corners);
    }
  }

  paintJoints(context, frame) {
    const poses = Object.fromEntries(this.scene.solids.map((s, i) => [s.name, i ? frame.bodies[i - 1] : frame.tool]));
    context.strokeStyle = this.colours.ink;
    context.fillStyle = this.colours.panel;
    context.lineWidth = 1.5 * this.plane.ratio;
    for (const ends of this.scene.joints) {
      if (ends.some(({ solid }) => solid && !poses[solid])) continue;
      const [a, b] = ends.map(({ solid, point }) => this.plane.toPixels(solid ? placed(point, poses[solid]) : point));
      if (ends[0].type === "spring") zigzag(context, a, b, 7 * this.plane.ratio);
      context.beginPath();
      if (ends[0].type === "pin") context.arc(...a, 4 * this.plane.ratio, 0, 2 * Math.PI);
      else context.rect(a[0] - 4 * this.plane.ratio, a[1] - 4 * this.plane.ratio, 8 * this.plane.ratio, 8 * this.plane.ratio);
      context.fill();
      context.stroke();
    }
  }

  // A spring that does not hold is a thin broken line.
  paintCoupling(context, { handle, tool, coupled }) {
    context.strokeStyle = coupled ? this.colours.coupling : this.colours.soft;
    context.lineWidth = (coupled ? 3 : 1.5) * this.plane.ratio;
    if (!coupled) context.setLineDash([6 * this.plane.ratio, 6 * this.plane.ratio]);
    zigzag(context, this.plane.toPixels(handle), this.plane.toPixels(tool), coupled ? 6 * this.plane.ratio : 0);
    context.setLineDash([]);
  }

  paintContact(context, [, , x, y, , , fx, fy]) {
    const place = this.plane.toPixels([x, y]);
    context.fillStyle = this.colours.contact;
    context.beginPath();
    context.arc(...place, 3.5 * this.plane.ratio, 0, 2 * Math.PI);
    context.fill();
    this.arrow(context, place, [fx, fy], this.colours.contact);
  }

  paintTarget(context, target) {
    const [x, y] = this.plane.toPixels(target);
    const r = 12 * this.plane.ratio;
    context.strokeStyle = this.colours.target;
    context.lineWidth = 1.5 * this.plane.ratio;
    context.beginPath();
    context.arc(x, y, r, 0, 2 * Math.PI);
    context.stroke();
    const [c, s] = [Math.cos(target[2]), Math.sin(target[2])];
    line(context, x + r * c, y - r * s, x + 1.6 * r * c, y - 1.6 * r * s);
  }

  paintHandle(context, { handle, felt, force }) {
    const place = this.plane.toPixels(handle);
    const r = 7 * this.plane.ratio;
    this.arrow(context, place, felt ?? force ?? [0, 0], this.colours.force);
    context.fillStyle = this.colours.handle;
    context.strokeStyle = this.colours.panel;
    context.lineWidth = 2 * this.plane.ratio;
    context.beginPath();
    context.arc(...place, r, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
    line(context, ...place, place[0] + r * Math.cos(handle[2]), place[1] - r * Math.sin(handle[2]));
  }

  arrow(context, [x, y], [fx, fy], colour) {
    const size = Math.hypot(fx, fy);
    const length = Math.min(LONGEST_ARROW, PIXELS_PER_NEWTON * size) * this.plane.ratio;
    if (length < 3) return;
    const [ux, uy] = [fx / size, -fy / size];
    const head = Math.min(9 * this.plane.ratio, length);
    const [tx, ty] = [x + ux * length, y + uy * length];
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 3 * this.plane.ratio;
    line(context, x, y, tx - ux * head, ty - uy * head);
    path(context, [[tx, ty], [tx - ux * head - uy * head * 0.5, ty - uy * head + ux * head * 0.5],
      [tx - ux * head + uy * head * 0.5, ty - uy * head - ux * head * 0.5]]);
    context.fill();
  }
}
