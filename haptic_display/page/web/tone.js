// SPDX-License-Identifier: Apache-2.0
// A tone as loud as the force; silent until it is asked for.

const FULL = 15; // N

export class Tone {
  constructor(box) {
    box.addEventListener("change", () => (box.checked ? this.begin() : this.end()));
  }

  begin() {
    this.audio ??= new AudioContext();
    this.voice = this.audio.createOscillator();
    this.loudness = this.audio.createGain();
    this.loudness.gain.value = 0;
    this.voice.frequency.value = 180;
    this.voice.connect(this.loudness).connect(this.audio.destination);
    this.voice.start();
  }

  end() {
    this.voice?.stop();
    this.voice = this.loudness = null;
  }

  // 0 to 0.3; null while it is off.
  get gain() {
    return this.loudness?.gain.value ?? null;
  }

  // force [N]
  set(force) {
    this.loudness?.gain.setTargetAtTime(Math.min(1, force / FULL) * 0.3, this.audio.currentTime, 0.02);
  }
}
