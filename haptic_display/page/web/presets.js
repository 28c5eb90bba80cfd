// SPDX-License-Identifier: Apache-2.0
// A parameter file of this machine is sent to the viewer, which sets what it can of it.

const LARGEST = 65536; // bytes

// Makes the button ask for a file and send it. before() is called ahead of that; said(sentence, done) with the answer.
export function loading(button, input, before, said) {
  button.addEventListener("click", () => input.click());
  input.addEventListener("change", async () => {
    const [file] = input.files;
    input.value = ""; // so that the same file can be chosen again
    if (!file) return;
    if (file.size > LARGEST) {
      said(`${file.name} has ${Math.ceil(file.size / 1024)} kB; the limit is ${LARGEST / 1024} kB`, false);
      return;
    }
    said("loading", true);
    before();
    try {
      const answer = await fetch("operating_point.yaml", { method: "POST", body: file });
      said(`${file.name}: ${(await answer.text()).trim()}`, answer.ok);
    } catch {
      said("Not loaded: no connection to the viewer.", false);
    }
  });
}
