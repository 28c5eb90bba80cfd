// SPDX-License-Identifier: Apache-2.0
// Draws the scene: what stands still is painted once on a layer of its own, what moves with every frame.

import { paintWay } from "./ghost.js";
import { grip, line, path, placed, spiral, trace, zigzag } from "./pen.js";
import { Plane } from "./plane.js";
import { colours } from "./theme.js";

const PIXELS_PER_NEWTON = 6;
const LONGEST_ARROW = 140;
const AROUND = 0.01; // m that are seen around handle and tool
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
    if (scene) this.look(scene.room);
    else this.fit();
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

  // Shows scene, workspace, tool and handle, wherever they are.
  fit() {
    const rooms = this.scene ? [this.scene.room] : [];
    if (this.workspace) rooms.push([0, 1, 0, 1].map((axis, side) => (this.workspace[axis] ?? [-0.05, 0.05])[side < 2 ? 0 : 1]));
    for (const at of [this.lastTool, this.frame?.handle]) {
      if (at) rooms.push([at[0] - AROUND, at[1] - AROUND, at[0] + AROUND, at[1] + AROUND]);
    }
    this.look(together(rooms));
  }

  // Shows a part of the plane: left, bottom, right, top [m].
  look(room) {
    if (room) this.plane.room = room;
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
    this.paintOutside(context, frame.handle);
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
    context.strokeStyle = this.colours.ink;
    context.lineWidth = 2 * this.plane.ratio;
    grip(context, this.plane, tool.outlines, this.lastTool);
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

  paintSolid(context, solid, pose, colour, alpha) {
    context.globalAlpha = alpha;
    context.fillStyle = colour;
    context.strokeStyle = this.colours.ink;
    context.lineWidth = this.plane.ratio;
    for (const outline of solid.outlines) {
      trace(context, this.plane, outline, pose);
      context.fill();
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  paintJoints(context, frame) {
    const poses = Object.fromEntries(this.scene.solids.map((s, i) => [s.name, i ? frame.bodies[i - 1] : frame.tool]));
    context.strokeStyle = this.colours.ink;
    context.fillStyle = this.colours.panel;
    context.lineWidth = 1.5 * this.plane.ratio;
    for (const [i, ends] of this.scene.joints.entries()) {
      if (ends.some(({ solid }) => solid && !poses[solid])) continue;
      const [a, b] = ends.map(({ solid, point }) => this.plane.toPixels(solid ? placed(point, poses[solid]) : point));
      const { type } = ends[0];
      if (this.scene.sprung[i] && type === "pin") spiral(context, a, 14 * this.plane.ratio);
      else if (this.scene.sprung[i] || type === "spring") zigzag(context, a, b, 7 * this.plane.ratio);
      for (const at of type === "spring" ? [a, b] : [a]) this.paintAnchor(context, type, at);
    }
  }

  // A ring for a pin, a square for a slider, a cross for a weld, a dot for either end of a spring.
  paintAnchor(context, type, [x, y]) {
    const r = (type === "spring" ? 2 : 4) * this.plane.ratio;
    context.beginPath();
    if (type === "slider") context.rect(x - r, y - r, 2 * r, 2 * r);
    else if (type !== "weld") context.arc(x, y, r, 0, 2 * Math.PI);
    else for (const side of [-r, r]) line(context, x - r, y - side, x + r, y + side);
    context.fill();
    context.stroke();
  }

  // An arrow at the edge to each of tool, handle and workspace that is out of view.
  paintOutside(context, handle) {
    const near = this.workspace && this.plane.middle.map((at, i) => Math.max(this.workspace[i]?.[0] ?? 0, Math.min(this.workspace[i]?.[1] ?? 0, at)));
    const places = Object.entries({ tool: this.lastTool, handle, workspace: near }).filter(([, at]) => at && this.plane.edge(at));
    this.canvas.dataset.outside = places.map(([name]) => name).join(" ");
    context.font = `600 ${13 * this.plane.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    for (const [i, [name, place]] of places.entries()) {
      const [[x, y], [px, py]] = [this.plane.edge(place), this.plane.toPixels(place)];
      const way = Math.hypot(px - x, py - y);
      this.arrow(context, [x, y], [(4 * (px - x)) / way, (4 * (y - py)) / way], this.colours[name] ?? this.colours.soft);
      context.textAlign = px < x ? "left" : "right";
      context.fillStyle = this.colours.ink;
      context.fillText(name, x, y + (4 + 15 * i) * this.plane.ratio);
    }
  }

  // A spring that does not hold is a thin broken line.
  paintCoupling(context, { handle, tool, coupled }) {
    context.strokeStyle = coupled ? this.colours.coupling : this.colours.soft;
    context.lineWidth = (coupled ? 3 : 1.5) * this.plane.ratio;
    if (!coupled) context.setLineDash([6 * this.plane.ratio, 6 * this.plane.ratio]);
    zigzag(context, this.plane.toPixels(handle), this.plane.toPixels(tool), coupled ? 10 * this.plane.ratio : 0);
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

// The least room around all of these; undefined for none.
export function together(rooms) {
  return rooms.length ? rooms[0].map((_, side) => (side < 2 ? Math.min : Math.max)(...rooms.map((room) => room[side]))) : undefined;
}
