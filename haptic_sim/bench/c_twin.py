# SPDX-License-Identifier: Apache-2.0
"""Kernels beside their twins in C at -O2, compiled on the spot: time, and the same results."""

import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

from haptic_device.analysis.zwidth import OPERATORS, Setup, record_of
from haptic_device.device import load_device
from haptic_device.law import servo
from haptic_device.node.declared import NODES
from haptic_device.runtime import recompute, zwidth_cell
from haptic_sim.bench.c_source import REAL, REALS, Program
from haptic_sim.bench.servo import COMMON, values
from haptic_sim.lockstep import Lockstep
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation

COMPILERS = ("cc", "gcc", "clang")
MISSING = f"no C compiler ({', '.join(COMPILERS)}) is installed: nothing to compare with"
REPEATS = 15  # of which the fastest counts
TICKS = 14000  # from the first push of the coupling to a wall

_CLOCK = """
static double now(void) {
  struct timespec t; clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t); return t.tv_sec + 1e-9 * t.tv_nsec;
}
static void *bytes(const char *path, long size) {
  void *room = malloc(size); FILE *file = fopen(path, "rb");
  if (!file || fread(room, 1, size, file) != (size_t)size) exit(1);
  fclose(file); return room;
}
static void keep(const char *path, const void *room, long size) {
  FILE *file = fopen(path, "wb"); if (!file || fwrite(room, 1, size, file) != (size_t)size) exit(1); fclose(file);
}
"""


class CompilerError(ValueError):
    """No compiler of C, or none that compiles the law; one sentence."""


def compiler() -> str | None:
    """The C compiler of this machine."""
    return next((name for name in COMPILERS if shutil.which(name)), None)


def build(program: Program, main: str, folder: Path) -> Path:
    """The program compiled at -O2; CompilerError if there is no compiler or it refuses."""
    if (name := compiler()) is None:
        raise CompilerError(MISSING)
    source, made = folder / "law.c", folder / "law"
    source.write_text(program.text() + _CLOCK + main)
    done = subprocess.run([name, "-O2", "-o", made, source, "-lm"], capture_output=True, text=True)
    if done.returncode:
        [said] = done.stderr.strip().splitlines()[:1] or [f"exit code {done.returncode}"]
        raise CompilerError(f"{name} does not compile the law, nothing to compare with: {said}")
    return made


def recorded(ticks: int = TICKS):
    """Settings, memory at the start, and rows with inputs, of a peg on its way into the hole with everything on."""
    driver = values(**COMMON, **{"engage.time": 0.05})
    scene = load("peg_in_hole")
    hand = {parameter.name: parameter.default for parameter in NODES["haptic_loopback"]}
    hand |= {f"motion.{key}": value for key, value in scene.motion.items()}
    system = Lockstep(load_device("desktop"), driver, hand, Simulation(scene))
    system.run(0.5)
    memory = system.memory.copy()
    return system.settings.copy(), memory, system.run(ticks / driver["servo.rate"]).view(np.ndarray)


_TICK = """
int main(int count, char **at) {
  long ticks = atol(at[4]), size = ticks * sizeof(struct ROW); double best = 1e9;
  struct SETTINGS *settings = bytes(at[1], sizeof *settings);
  struct MEMORY *memory = bytes(at[2], sizeof *memory), *work = malloc(sizeof *work);
  struct ROW *rows = bytes(at[3], size), *out = malloc(size);
  for (int turn = 0; turn < atoi(at[6]); turn++) {
    *work = *memory; memcpy(out, rows, size);
    double began = now();
    for (long k = 0; k < ticks; k++) {
      for (int i = 0; i < 3; i++) { settings->margin[i] = out[k].margin[i]; settings->surplus[i] = out[k].surplus[i]; }
      FUNCTION(settings, work, &out[k]);
    }
    double spent = now() - began; if (spent < best) best = spent;
  }
  keep(at[5], out, size); printf("%.9e\\n", best / ticks); return count != 7;
}
"""


class TickTwin:
    """The servo's tick, 3 axes, 4 walls and all, as kernel and in C on the same recorded inputs."""

    def __init__(self, folder: Path, ticks: int = TICKS):
        program = Program()
        kinds = [program.record(dtype) for dtype in (servo.SETTINGS, servo.MEMORY, servo.TICK)]
        function = program.function(servo.tick, kinds)
        main = _TICK.replace("FUNCTION", function.name)
        for word, kind in zip(("SETTINGS", "MEMORY", "ROW"), kinds, strict=True):
            main = main.replace(f"struct {word}", f"struct {kind.name}")
        self._made, self._folder, self._records = build(program, main, folder), folder, recorded(ticks)
        for name, record in zip(("settings", "memory", "rows"), self._records, strict=True):
            record.tofile(folder / name)
        self.rows = np.zeros(0, servo.TICK)

    def kernel(self) -> float:
        """Time of a tick [s]; its rows are in `rows`."""
        settings, memory, rows = (record.copy().view(np.recarray) for record in self._records)
        best = np.inf
        for _ in range(REPEATS):
            work, out = memory.copy(), rows.copy()
            began = time.thread_time()
            recompute.recompute(settings, work, out, recompute.NO_SETS)
            best = min(best, time.thread_time() - began)
        self.rows = out.view(np.ndarray)
        return best / len(rows)

    def c(self) -> float:
        """The same of the twin."""
        names = [str(self._folder / name) for name in ("settings", "memory", "rows")]
        given = [*names, str(len(self._records[2])), str(self._folder / "out"), str(REPEATS)]
        best = float(subprocess.run([self._made, *given], capture_output=True, text=True, check=True).stdout)
        self.rows = np.fromfile(self._folder / "out", servo.TICK)
        return best


_CELL = """
int main(int count, char **at) {
  long cells = atol(at[3]); double best = 1e9;
  struct SETUP *setup = bytes(at[1], sizeof *setup); double *stiffness = bytes(at[2], 8 * cells);
  struct OUT *out = calloc(cells, sizeof *out); double room[128];
  struct reals waiting = {room, (long long)setup->delay_samples + 1};
  for (int turn = 0; turn < atoi(at[5]); turn++) {
    double began = now();
    for (long k = 0; k < cells; k++) FUNCTION(setup, stiffness[k], 0.0, waiting, &out[k]);
    double spent = now() - began; if (spent < best) best = spent;
  }
  keep(at[4], out, cells * sizeof *out); printf("%.9e\\n", best / cells); return count != 6;
}
"""


class CellTwin:
    """A cell of the Z-width map, the sweep's kernel, as kernel and in C."""

    def __init__(self, folder: Path, cells: int = 200):
        program = Program()
        kinds = [program.record(zwidth_cell.CELL), REAL, REAL, REALS, program.record(zwidth_cell.OUTCOME)]
        function = program.function(zwidth_cell.cell, kinds)
        main = _CELL.replace("FUNCTION", function.name).replace("struct SETUP", f"struct {kinds[0].name}")
        self._made = build(program, main.replace("struct OUT", f"struct {kinds[4].name}"), folder)
        self._setup = record_of(Setup(0.1, 0.5, 1e-3, resolution=1e-6), OPERATORS["none"][0])
        self._stiffness = np.linspace(10.0, 3000.0, cells)
        self._folder, self.outcomes = folder, np.zeros(0, zwidth_cell.OUTCOME)
        self._setup.tofile(folder / "setup")
        self._stiffness.tofile(folder / "stiffness")

    def kernel(self) -> float:
        """Time of a cell [s]; what came of all is in `outcomes`."""
        best, damping = np.inf, np.zeros_like(self._stiffness)
        self.outcomes = np.zeros(len(damping), zwidth_cell.OUTCOME)
        for _ in range(REPEATS):
            began = time.thread_time()
            zwidth_cell.cells(self._setup.view(np.recarray), self._stiffness, damping,
                              self.outcomes.view(np.recarray))  # fmt: skip
            best = min(best, time.thread_time() - began)
        return best / len(damping)

    def c(self) -> float:
        """The same of the twin."""
        given = [self._folder / "setup", self._folder / "stiffness", str(len(self._stiffness)), self._folder / "out"]
        done = subprocess.run([self._made, *given, str(REPEATS)], capture_output=True, text=True, check=True)
        self.outcomes = np.fromfile(self._folder / "out", zwidth_cell.OUTCOME)
        return float(done.stdout)
