// SPDX-License-Identifier: Apache-2.0
// The websocket to the viewer: opens again by itself for ever; the newest frame counts, older ones are not kept. What
// is asked for while there is no connection is answered here: it was not sent. Only what stops waits, and goes first.

const STOPS = { estop: "E-STOP", disable: "Disable" };
const SILENT = 4000; // ms without a word after which a connection is given up; the viewer speaks four times a second
const UNANSWERED = 1000; // ms after which a stop that was sent is spoken of

export class Link {
  constructor(onNews, onConnected) {
    this.onNews = onNews;
    this.onConnected = onConnected;
    this.frame = null;
    this.number = 0;
    this.received = 0;
    this.stops = new Set(); // that no answer has come to
    this.open();
    setInterval(() => this.listen(), 500);
  }

  open() {
    const address = new URL("socket", location.href);
    address.protocol = "ws:";
    address.search = address.hash = "";
    this.heard = performance.now();
    this.socket = new WebSocket(address);
    this.socket.onopen = () => {
      this.stops.forEach((service) => this.send({ do: "trigger", service }));
      this.tell(true, "");
    };
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = () => this.again();
  }

  async again() {
    let sentence = "The viewer does not answer; trying again.";
    try {
      const answer = await fetch("icon.svg", { cache: "no-store", signal: AbortSignal.timeout(SILENT) });
      if (answer.status === 403) sentence = "The viewer was started anew: open the address that it printed now.";
    } catch {
      // it is not there: said above
    }
    this.tell(false, sentence);
    setTimeout(() => this.open(), 500);
  }

  // A connection over which nothing comes is none.
  listen() {
    if (this.socket.readyState > WebSocket.OPEN || performance.now() < this.heard + SILENT) return;
    this.socket.onopen = this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    this.again();
  }

  tell(open, sentence) {
    const waiting = [...this.stops].map((service) => ` ${STOPS[service]} has NOT been heard: it is sent as soon as there is a connection.`);
    this.onConnected(open, open ? "" : sentence + waiting.join(""));
  }

  take(message) {
    this.heard = performance.now();
    if (message.kind === "frame") {
      this.frame = message.content;
      this.number = message.number;
      this.received += 1;
    } else {
      if (message.kind.startsWith("answer")) this.stops.delete(message.content.to.service);
      this.onNews(message.kind.split(" ")[0], message.content);
    }
  }

  // The newest frame that has not been drawn yet, or null; tells the viewer that it has been taken.
  next() {
    const frame = this.frame;
    this.frame = null;
    if (frame) this.send({ do: "seen", frame: this.number });
    return frame;
  }

  // What a person asks for: sent, or answered that it was not.
  say(message) {
    const stops = message.do === "trigger" && message.service in STOPS;
    if (stops) this.waitFor(message.service);
    if (this.send(message)) return;
    const sentence = stops ? `No connection: ${STOPS[message.service]} is sent as soon as there is one.` : "Not sent: no connection to the viewer.";
    if (message.do === "aim") this.onNews("hint", sentence);
    else this.onNews("answer", { to: message, done: false, sentence });
  }

  waitFor(stop) {
    this.stops.add(stop);
    setTimeout(() => {
      if (this.stops.has(stop)) this.onNews("hint", `${STOPS[stop]} has not been answered yet.`);
    }, UNANSWERED);
  }

  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
