// SPDX-License-Identifier: Apache-2.0
// What each thing on the page is, in plain words: in one line at the foot of the page for what is pointed at or has the
// focus, in the panel "What is what" for all, and to screen readers as the description of each control.

import { element } from "./element.js";

const EXPERT = true;
// What is explained (a selector), its name, what it is, and whether only experts see it.
const WORDS = [
  ["#state", "State", "Idle: the motor is off. Waiting: lead the handle to the tool. Engaged: you feel the tool. Fault: it stopped by itself."],
  ["[data-service='enable']", "Engage", "Turns the force on, slowly. From then on you feel the tool."],
  ["[data-service='disable']", "Disable", "Turns the force off. The handle moves freely."],
  ["[data-service='reset']", "Reset", "Clears a fault. Press Engage afterwards."],
  ["#estop", "E-STOP", "Cuts all force at once. So does the Esc key, wherever you are on this page."],
  ["#layer", "Expert", "Shows all figures and settings, or only what everybody needs."],
  ["#theme", "Colours", "Light, dark, or as your system has it."],
  ["#scene", "Plane", "Blue dot: the handle. Orange: the tool. Green: the spring between them. Arrow: the force on the hand. Purple: contacts. Dashed: how far the handle goes. Dotted: how far its links reach."],
  ["div:has(> #force)", "Force on the hand", "How hard the handle pushes your hand. 1 N is the weight of 100 g."],
  ["div:has(> #torque)", "Torque", "How hard the handle twists your hand.", EXPERT],
  ["div:has(> #stretch)", "Coupling stretched", "How far the tool is from the handle. The spring between them pulls the harder, the longer it is.", EXPERT],
  ["#results > div", "Results", "How far the job is done, as the scene counts it."],
  ["#hold", "Hold", "The hand stays where you let it go, and goes on pressing. Press it again to let go."],
  ["#take_over", "Take over", "This page leads the hand from now on, and the other page does not."],
  ["#turn_left, #turn_right", "Turn", "Turns the hand by 1°; keep it pressed to go on."],
  ["#zoom_in, #zoom_out", "Zoom", "Shows a smaller or a larger part of the plane."],
  ["#fit", "Fit", "Shows scene, tool, handle and workspace, wherever they are."],
  ["figure:has(#strip_force)", "Force on the hand, last 10 s", "Line: what the motor gives. Dashed: what the hand feels."],
  ["figure:has(#strip_energy)", "Energy", "Work given to the hand and to the tool since the start. Up: given; down: taken back.", EXPERT],
  ["figure:has(#strip_age)", "Age of the tool sample", "How old the tool's place is when the motor uses it. Old news makes the feel softer.", EXPERT],
  ["#pause", "Pause", "The charts stand still, or go on. What you do goes on in either case."],
  ["#closer, #wider", "Shorter, longer", "Show a shorter or a longer time in the charts. So does the wheel, over a chart."],
  ["#scene_name", "Scene", "The tool and what it works on. Another one begins at its start."],
  ["#start_scene", "Back to the start", "Puts tool and hand back to where the scene begins. It clears a fault, too, and turns the force on again."],
  ["#next_scene", "Next", "Loads the next task."],
  ["#guide_play", "Show me", "The hand shows how it is done, until you lead it yourself."],
  ["#guide_step", "Step", "Shows a tenth of the way, then waits."],
  ["#guide_slow", "Slow", "Shows it at a quarter of the speed. What the tool works on is not slowed."],
  ["#legend > summary", "What the colours mean", "Each colour and mark in the plane."],
  ["#method_name", "Method", "How the computer works out the motion. Auto takes the best one for the scene.", EXPERT],
  ["#add_wall", "Add wall", "Puts a wall beside the handle. You feel it at once."],
  [slid("wall_", "_place"), "Place of a wall", "How far it is from the middle. Its dot in the plane can be dragged, too."],
  [slid("wall_", "_direction"), "Direction of a wall", "Which way its free side looks."],
  [slid("wall_", "_stiffness"), "Stiffness of a wall", "How hard it is. The band below shows what stays stable."],
  [slid("wall_", "_damping"), "Damping of a wall", "How much it brakes what pushes into it.", EXPERT],
  [".wall > button", "Remove", "Takes this wall away."],
  [slid("gain_", "_stiffness"), "How stiff the tool is held", "How hard the spring between handle and tool pulls. The band below shows what stays stable."],
  [slid("gain_", "_damping"), "How damped", "How much the swing of that spring is braked. The band below shows what stays stable."],
  ["#undo, #redo", "Undo, redo", "Takes back the last change of settings, or makes it again."],
  ["#defaults", "Defaults", "Puts all settings back to those at the start, in one step."],
  ["#load", "Load", "Takes the settings of a file, such as Save makes."],
  ["#save", "Save", "Downloads the present settings as a file that you can load or start with again."],
  ["#record", "Record", "Writes all that happens into a file, until you press it again."],
  ["#mark_text, #mark", "Mark", "Puts a word into the recording, to find the moment again."],
  [".gauge:has(#margin)", "Passivity margin", "How much of the device's own friction is left to keep it from shaking by itself. None left: lower the gains.", EXPERT],
  [".gauge:has(#margin_theta)", "Passivity margin about θ", "The same for turning.", EXPERT],
  ["#figures", "Servo and exchange", "How late the motor's control loop runs (µs), how old the tool's place is (ms), and what was missed. 99 of 100 are below p99.", EXPERT],
  ["#nodes", "Nodes", "The running programs and what each says. ● well, ▲ warning, ■ error.", EXPERT],
  ["#bag_path", "Saved in", "The folder of the last recording, to copy."],
  ["a[href*='film.html']", "Play", "Plays this recording again, in a new tab."],
  ["#earlier > summary", "Recordings", "The recordings in the folder, the newest first."],
  ["#offers, #offers select, #offers input", "Exchange", "How handle and tool talk to each other, and a delay to try out. A change starts the programs again.", EXPERT],
  ["#tone", "Tone", "A sound that grows with the force.", EXPERT],
  ["#looking", "View-only link", "Whoever opens it sees all this and moves nothing.", EXPERT],
  ["#rates", "Pictures per second", "How many come and are drawn, and how busy the viewer is.", EXPERT],
  ["#words .fold", "What is what", "All these explanations in one list."],
];

// All fields and sliders of a row whose slider's id begins and ends so.
function slid(begin, end) {
  return `.tuned:has([id^='${begin}'][id$='${end}']) input`;
}

// list: the <dl> that they are put into; line: where the one that is wanted is shown, else the text of `otherwise`.
export function explain(list, line, otherwise) {
  WORDS.forEach(([selector, name, text, expert], i) => {
    const pair = element("div");
    if (expert) pair.dataset.layer = "expert";
    pair.append(element("dt", { textContent: name }), element("dd", { textContent: text, id: `about_${i}` }));
    list.append(pair);
  });
  describeAll(document.body);
  new MutationObserver((changes) => {
    for (const { addedNodes } of changes) for (const one of addedNodes) if (one.matches) describeAll(one);
  }).observe(document.querySelector("aside"), { childList: true, subtree: true });
  const tell = (target) => {
    const text = wordsOf(target) || wordsOf(document.activeElement);
    if (line.textContent !== text) line.textContent = text;
    line.dataset.otherwise = otherwise.textContent;
  };
  tell(document.body);
  for (const name of ["pointerover", "focusin"]) document.addEventListener(name, ({ target }) => tell(target));
}

// Of the element, or of the control that it is the label of; "" where there is nothing to say.
function wordsOf(target) {
  const one = target.closest?.("label")?.control ?? target;
  const found = WORDS.find(([selector]) => one.closest?.(selector));
  return found ? `${found[1]}: ${found[2]}` : one.labels?.[0]?.querySelector("small")?.textContent ?? "";
}

// What is explained in a part of the page that has been put there, once each.
function describeAll(part) {
  WORDS.forEach(([selector], i) => {
    const found = [...part.querySelectorAll(selector)];
    for (const one of part.matches(selector) ? [part, ...found] : found) describe(one, `about_${i}`);
  });
}

function describe(one, id) {
  const before = one.getAttribute("aria-describedby")?.split(" ") ?? [];
  if (!before.includes(id)) one.setAttribute("aria-describedby", [...before, id].join(" "));
}
