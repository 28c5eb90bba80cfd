// SPDX-License-Identifier: Apache-2.0
// Draws the scene: what stands still is painted once on a layer of its own, what moves with every frame.

import { paintWay } from "./ghost.js";
import { paintLinks, paintReach, roomOf } from "./linkage.js";
import { circle, grip, line, outline, path, placed, spiral, trace, zigzag } from "./pen.js";
import { Plane } from "./plane.js";
import { colours } from "./theme.js";

const PIXELS_PER_NEWTON = 6;
const LONGEST_ARROW = 140;
const AROUND = 0.01; // m that are seen around handle and tool
const COLOURS = ["ground", "panel", "ink", "soft", "line", "grid", "handle", "tool", "fixed", "moving", "coupling",
  "force", "contact", "target", "second"];

export class SceneView {
  constructor(canvas) {
    this.canvas = canvas;
    this.plane = new Plane(canvas);
    this.still = document.createElement("canvas");
    this.scene = this.frame = null;
    this.walls = [];
    this.workspace = this.linkage = null;
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

  setSurroundings(walls, workspace, linkage) {
    const told = JSON.stringify([walls, workspace, linkage]);
    if (told === this.told) return;
    this.told = told;
    this.walls = walls;
    this.workspace = workspace;
    this.linkage = linkage;
    this.stale = true;
    if (!this.scene) this.fit();
  }

  // Shows scene, workspace, tool and handle, wherever they are.
  fit() {
    const rooms = this.scene ? [this.scene.room] : [];
    if (this.workspace) rooms.push([0, 1, 0, 1].map((axis, side) => (this.workspace[axis] ?? [-0.05, 0.05])[side < 2 ? 0 : 1]));
    if (this.linkage) rooms.push(roomOf(this.linkage));
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
    if (this.linkage && frame.handle) paintLinks(context, this, this.linkage, frame.handle);
    this.paintMoving(context, frame);
    if (frame.handle && frame.tool) this.paintCoupling(context, frame);
    for (const contact of frame.contacts) this.paintContact(context, contact);
    if (frame.target) this.paintTarget(context, frame.target);
    if (frame.handle) this.paintHandle(context, frame);
    this.paintOutside(context, frame.handle);
    if (frame.other) this.paintOther(context, frame.other);
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
    if (this.linkage) paintReach(context, this, this.linkage);
    if (this.scene?.task) paintWay(context, this, this.scene);
  }

  // How strokes are drawn from now on, in pixels of the page.
  pen(context, colour, width, dash = []) {
    const { ratio } = this.plane;
    Object.assign(context, { strokeStyle: colour, lineWidth: width * ratio });
    context.setLineDash(dash.map((pixels) => pixels * ratio));
  }

  say(context, text, x, y, textAlign) {
    const font = `600 ${13 * this.plane.ratio}px system-ui, "DejaVu Sans", sans-serif`;
    Object.assign(context, { font, textAlign, fillStyle: this.colours.ink });
    context.fillText(text, x, y);
  }

  paintWorkspace(context) {
    if (!this.workspace) return;
    const [x, y] = [this.workspace[0], this.workspace[1] ?? [-0.01, 0.01]];
    const [left, top] = this.plane.toPixels([x[0], y[1]]);
    const [right, bottom] = this.plane.toPixels([x[1], y[0]]);
    this.pen(context, this.colours.soft, 1.5, [8, 6]);
    context.strokeRect(left, top, right - left, bottom - top);
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
    this.pen(context, this.colours.handle, 2);
    line(context, ...ends[0], ...ends[1]);
  }

  paintMoving(context, frame) {
    this.lastTool = frame.tool ?? this.lastTool;
    if (!this.scene || !this.lastTool) return;
    const [tool, ...bodies] = this.scene.solids;
    bodies.forEach((solid, i) => {
      if (!solid.fixed && frame.bodies[i]) this.paintSolid(context, solid, frame.bodies[i], this.colours.moving, 0.9);
    });
    this.pen(context, this.colours.ink, 2);
    grip(context, this.plane, tool.outlines, this.lastTool);
    this.paintTool(context, tool, frame.tool ? this.unfelt : "simulation silent");
    this.paintJoints(context, frame);
  }

  // One that is not felt is faded, with a broken outline and the reason.
  paintTool(context, tool, unfelt) {
    this.canvas.dataset.unfelt = unfelt;
    this.paintSolid(context, tool, this.lastTool, this.colours.tool, unfelt ? 0.3 : 0.85, unfelt ? [4, 4] : []);
    const [x, y] = this.plane.toPixels(this.lastTool);
    this.say(context, unfelt, x + 16 * this.plane.ratio, y - 16 * this.plane.ratio, "left");
  }

  paintSolid(context, solid, pose, colour, alpha, dash) {
    this.pen(context, this.colours.ink, 1, dash);
    Object.assign(context, { globalAlpha: alpha, fillStyle: colour });
    for (const outline of solid.outlines) {
      trace(context, this.plane, outline, pose);
      context.fill();
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  paintJoints(context, frame) {
    const poses = Object.fromEntries(this.scene.solids.map((s, i) => [s.name, i ? frame.bodies[i - 1] : frame.tool]));
    this.pen(context, this.colours.ink, 1.5);
    context.fillStyle = this.colours.panel;
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
    else if (type !== "weld") circle(context, [x, y], r);
    else for (const side of [-r, r]) line(context, x - r, y - side, x + r, y + side);
    context.fill();
    context.stroke();
  }

  // An arrow at the edge to each of tool, handle and workspace that is out of view.
  paintOutside(context, handle) {
    const near = this.workspace && this.plane.middle.map((at, i) => Math.max(this.workspace[i]?.[0] ?? 0, Math.min(this.workspace[i]?.[1] ?? 0, at)));
    const places = Object.entries({ tool: this.lastTool, handle, workspace: near }).filter(([, at]) => at && this.plane.edge(at));
    this.canvas.dataset.outside = places.map(([name]) => name).join(" ");
    for (const [i, [name, place]] of places.entries()) {
      const [[x, y], [px, py]] = [this.plane.edge(place), this.plane.toPixels(place)];
      const way = Math.hypot(px - x, py - y);
      this.arrow(context, [x, y], [(4 * (px - x)) / way, (4 * (y - py)) / way], this.colours[name] ?? this.colours.soft);
      this.say(context, name, x, y + (4 + 15 * i) * this.plane.ratio, px < x ? "left" : "right");
    }
  }

  // A spring that does not hold is a thin broken line.
  paintCoupling(context, { handle, tool, coupled }) {
    if (coupled) this.pen(context, this.colours.coupling, 3);
    else this.pen(context, this.colours.soft, 1.5, [6, 6]);
    zigzag(context, this.plane.toPixels(handle), this.plane.toPixels(tool), coupled ? 10 * this.plane.ratio : 0);
  }

  paintContact(context, [, , x, y, , , fx, fy]) {
    const place = this.plane.toPixels([x, y]);
    context.fillStyle = this.colours.contact;
    circle(context, place, 3.5 * this.plane.ratio);
    context.fill();
    this.arrow(context, place, [fx, fy], this.colours.contact);
  }

  paintTarget(context, target) {
    const [x, y] = this.plane.toPixels(target);
    const r = 12 * this.plane.ratio;
    this.pen(context, this.colours.target, 1.5);
    circle(context, [x, y], r);
    context.stroke();
    const [c, s] = [Math.cos(target[2]), Math.sin(target[2])];
    line(context, x + r * c, y - r * s, x + 1.6 * r * c, y - 1.6 * r * s);
  }

  paintHandle(context, { handle, felt, force }) {
    const place = this.plane.toPixels(handle);
    const r = 7 * this.plane.ratio;
    this.arrow(context, place, felt ?? force ?? [0, 0], this.colours.force);
    this.pen(context, this.colours.panel, 2);
    context.fillStyle = this.colours.handle;
    circle(context, place, r);
    context.fill();
    context.stroke();
    line(context, ...place, place[0] + r * Math.cos(handle[2]), place[1] - r * Math.sin(handle[2]));
  }

  // What another recording shows at the same time, as broken outlines.
  paintOther(context, { scene, handle, tool, bodies, felt }) {
    this.pen(context, this.colours.second, 2, [6, 4]);
    for (const [i, solid] of (scene?.solids ?? []).entries()) {
      const pose = i ? bodies[i - 1] : tool;
      if (!solid.fixed && pose) outline(context, this.plane, solid.outlines, pose);
    }
    if (!handle) return;
    outline(context, this.plane, [[[[0, 0]], (7 * this.plane.ratio) / this.plane.scale]], handle);
    this.arrow(context, this.plane.toPixels(handle), felt ?? [0, 0], this.colours.second);
  }

  arrow(context, [x, y], [fx, fy], colour) {
    const size = Math.hypot(fx, fy);
    const length = Math.min(LONGEST_ARROW, PIXELS_PER_NEWTON * size) * this.plane.ratio;
    if (length < 3) return;
    const [ux, uy] = [fx / size, -fy / size];
    const head = Math.min(9 * this.plane.ratio, length);
    const [tx, ty] = [x + ux * length, y + uy * length];
    this.pen(context, colour, 3);
    context.fillStyle = colour;
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
