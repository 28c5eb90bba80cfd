// SPDX-License-Identifier: Apache-2.0
// One recording of the page: numbers as they were packed, made into what is drawn at a time.

export class Recording {
  // shift [s]: from its own times, which are those of its report, to those of the page.
  constructor(film) {
    const { begin, steps: { length, angle, curve }, ...rest } = film;
    Object.assign(this, rest, { contact: rest.first_contact, shift: 0, first: begin });
    this.places = Object.fromEntries(Object.entries(film.places).map(([name, columns]) =>
      [name, columns.map((column, axis) => unpacked(column, axis < 2 ? length : angle))]));
    this.curves = Object.fromEntries(Object.entries(film.curves).map(([name, column]) => [name, unpacked(column, curve)]));
    this.force = film.force.map((column) => unpacked(column, curve));
    this.loose = new Set(film.loose);
    this.contacts = new Map();
    for (const [picture, ...numbers] of film.contacts) {
      if (!this.contacts.has(picture)) this.contacts.set(picture, []);
      this.contacts.get(picture).push([0, 0, numbers[0], numbers[1], 0, 0, numbers[2], numbers[3]]);
    }
  }

  get begin() {
    return this.shift + this.first;
  }

  get end() {
    return this.begin + (this.count - 1) / this.rate;
  }

  // The picture at a time, or null outside of the recording.
  at(time) {
    const picture = Math.round((time - this.begin) * this.rate);
    return picture >= 0 && picture < this.count ? picture : null;
  }

  curve(name, time) {
    const picture = this.at(time);
    return picture === null ? null : this.curves[name]?.[picture] ?? null;
  }

  // As the live page has it from the viewer; `known`: whether the recording has this time.
  frame(time) {
    const picture = this.at(time);
    const place = (name) => together(this.places[name], picture);
    return {
      known: picture !== null,
      handle: place("handle"),
      tool: place("tool"),
      target: null,
      coupled: !this.loose.has(picture),
      bodies: (this.scene?.solids ?? []).slice(1).map((solid) => (solid.fixed ? solid.pose : place(solid.name))),
      contacts: this.contacts.get(picture) ?? [],
      force: null,
      energy: [null, null],
      results: [],
      felt: together(this.force, picture),
    };
  }
}

function together(columns, picture) {
  const numbers = columns?.map((column) => column?.[picture] ?? null);
  return numbers?.includes(null) ? null : numbers ?? null;
}

// Differences of whole steps made numbers again; null for a column of which nothing is known.
function unpacked(column, step) {
  if (column.length === 1 && column[0] === null) return null;
  let whole = 0;
  return column.map((difference) => (difference === null ? null : step * (whole += difference)));
}
