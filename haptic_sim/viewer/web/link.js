// SPDX-License-Identifier: Apache-2.0
// The websocket to the viewer: opens again by itself for ever; the newest frame counts, older ones are not kept.

export class Link {
  constructor(onNews, onConnected) {
    this.onNews = onNews;
    this.onConnected = onConnected;
    this.frame = null;
    this.number = 0;
    this.received = 0;
    this.open();
  }

  open() {
    const address = new URL("socket", location.href);
    address.protocol = "ws:";
    address.search = address.hash = "";
    this.socket = new WebSocket(address);
    this.socket.onopen = () => this.onConnected(true, "");
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = () => this.again();
  }

  async again() {
    let sentence = "The viewer does not answer; trying again.";
    try {
      const answer = await fetch("icon.svg", { cache: "no-store" });
      if (answer.status === 403) sentence = "The viewer was started anew: open the address that it printed now.";
    } catch {
      // it is not there: said above
    }
    this.onConnected(false, sentence);
    setTimeout(() => this.open(), 500);
  }

  take(message) {
    if (message.kind === "frame") {
      this.frame = message.content;
      this.number = message.number;
      this.received += 1;
    } else {
      this.onNews(message.kind.split(" ")[0], message.content);
    }
  }

  // The newest frame that has not been drawn yet, or null; tells the viewer that it has been taken.
  next() {
    const frame = this.frame;
    this.frame = null;
    if (frame) this.say({ do: "seen", frame: this.number });
    return frame;
  }

  say(wish) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(wish));
  }
}
