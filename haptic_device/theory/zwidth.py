# SPDX-License-Identifier: Apache-2.0
"""Z-width of a device model: which walls in the K–B plane it shows without shaking and without giving energy.

Each cell of the plane is a run in lock-step (`haptic_device.device.wall_tapping`): an operator taps the unilateral
wall and stays pressed against it. What a run can show depends on the operator, so operators are named, and none of
them is the worst there is: condition (3) is about all passive ones (Colgate & Brown 1994 for the word Z-width).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.control.passivity import largest_stiffness
from haptic_device.device import wall_tapping
from haptic_device.theory.delay import largest_passive_stiffness
from haptic_device.theory.quantity import Array, finite, not_negative, positive, within
from haptic_device.theory.stability import largest_stable_stiffness

QUIET, GIVING, SHAKING = range(3)
NAMES = ("quiet", "gives energy", "shakes")
SETTLED = 1e-6  # of the energy of the beginning: what is left at rest
ROUNDING = 1e-9  # of the energy of the beginning, that may seem given


class Setup(NamedTuple):
    """A model of a device and its loop, for a run that taps a wall.

    Attributes:
        mass: moving mass m [kg].
        physical_damping: b [N s/m].
        period: T of the servo [s].
        coulomb: Coulomb friction [N].
        resolution: step of the encoder [m].
        delay_samples: delay of sensing and acting together, in periods.
        velocity_lag: time constant of the filter on the velocity [s].
        seconds: length of a run [s].

    Examples:
        >>> from haptic_device.theory.zwidth import Setup
        >>> Setup(mass=0.1, physical_damping=1.0, period=0.001).seconds
        1.0
    """

    mass: float
    physical_damping: float
    period: float
    coulomb: float = 0.0
    resolution: float = 0.0
    delay_samples: float = 0.0
    velocity_lag: float = 0.0
    seconds: float = 1.0


class Operator(NamedTuple):
    """Model of an operator who holds the handle. A tap starts 2 mm before the wall at 0.1 m/s.

    Attributes:
        mass: mass on the handle [kg].
        damping: damper on the handle [N s/m].
        stiffness: spring on the handle [N/m].
        push: constant force into the wall [N].
        pressed: whether a run begins in the wall, a third deeper than at rest, instead of with a tap.

    Examples:
        >>> from haptic_device.theory.zwidth import Operator
        >>> Operator(mass=0.5, damping=20.0, stiffness=1000.0, push=5.0).pressed
        False
    """

    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    push: float = 1.0
    pressed: bool = False


def _grid() -> tuple[Operator, ...]:
    """Operators without damper: masses and springs, whose push holds them 5 mm deep or 1 N strong in the wall."""
    masses, springs = (0.0, 0.1, 1.0), (0.0, 1e2, 1e3, 1e4)
    return tuple(Operator(m, 0.0, k, 1.0 + 5e-3 * k, True) for m in masses for k in springs)


def _both(mass: float, damping: float, stiffness: float, push: float) -> tuple[Operator, Operator]:
    hand = Operator(mass, damping, stiffness, push)
    return hand, hand._replace(pressed=True)


OPERATORS = {
    "none": _both(0.0, 0.0, 0.0, 1.0),
    "light": _both(0.05, 2.0, 50.0, 1.0),
    "firm": _both(0.5, 20.0, 1000.0, 5.0),
    "worst": _grid(),
}
"""Each hand taps, and is pressed; the grid is pressed only, where contact that is lost cannot hide a slow growth."""


class Outcome(NamedTuple):
    """Result of the walls, as arrays over the cells of the plane.

    Attributes:
        assessment: 0 quiet, 1 gives energy, 2 shakes; NAMES has the words.
        energy_given: energy given to the operator [J].
        growth: energy of the vibration in the last quarter of the run, divided by that in the quarter before.

    Examples:
        >>> from haptic_device.theory.zwidth import NAMES, Setup, operators_of, run_cells
        >>> outcome = run_cells(Setup(0.1, 1.0, 0.001), operators_of("none"), 1000.0, 0.0)
        >>> NAMES[outcome.assessment.item()]
        'quiet'
    """

    assessment: npt.NDArray[np.int8]
    energy_given: Array
    growth: Array


def check_setup(setup: Setup) -> None:
    """Refuse what cannot be a device or a run (ValueError, one sentence)."""
    for name, unit in (("mass", "kg"), ("physical_damping", "N s/m"), ("period", "s"), ("seconds", "s")):
        positive(name, getattr(setup, name), unit)
    for name, unit in (("coulomb", "N"), ("resolution", "m"), ("velocity_lag", "s")):
        not_negative(name, getattr(setup, name), unit)
    within("delay_samples", setup.delay_samples, 0.0, 100.0, "samples")
    within("seconds/period", setup.seconds / setup.period, wall_tapping.FEWEST_TICKS, 1e7, "ticks")


def operators_of(name: str) -> tuple[Operator, ...]:
    """The operators of a name.

    Each hand has one run with a tap and one run pressed; `worst` is a grid of pressed hands. Raises ValueError with one
    sentence for any other name.

    Args:
        name: none, light, firm or worst.

    Examples:
        >>> from haptic_device.theory.zwidth import operators_of
        >>> [hand.pressed for hand in operators_of("light")]
        [False, True]
    """
    if name not in OPERATORS:
        raise ValueError(f"operator is {name!r}, but it must be one of {', '.join(OPERATORS)}")
    return OPERATORS[name]


def run_cells(setup: Setup, operators: Sequence[Operator], stiffness: npt.ArrayLike, damping: npt.ArrayLike) -> Outcome:
    """Simulates operators that tap walls. Returns an Outcome with the worst result for each wall.

    Each cell is a run in lock-step against the exact motion of the device. Raises ValueError for a value out of range.

    Args:
        setup: the device.
        operators: from `operators_of`.
        stiffness: K of the walls [N/m], an array that broadcasts with damping.
        damping: B of the walls [N s/m], an array that broadcasts with stiffness.

    Examples:
        >>> from haptic_device.theory.zwidth import NAMES, Setup, operators_of, run_cells
        >>> outcome = run_cells(Setup(0.1, 1.0, 0.001), operators_of("none"), [1000.0, 4000.0], 0.0)
        >>> [NAMES[cell] for cell in outcome.assessment]
        ['quiet', 'shakes']
    """
    check_setup(setup)
    not_negative("stiffness", stiffness, "N/m")
    finite("damping", damping, "N s/m")
    stiffness, damping = (np.array(a, float) for a in np.broadcast_arrays(stiffness, damping))
    outcomes = [_run(setup, operator, stiffness.ravel(), damping.ravel()) for operator in operators]
    assessment, given, growth = (np.max(column, axis=0) for column in zip(*outcomes, strict=True))
    return Outcome(*(column.reshape(stiffness.shape) for column in (assessment.astype(np.int8), given, growth)))


def _run(
    setup: Setup, operator: Operator, stiffness: Array, damping: Array
) -> tuple[npt.NDArray[np.int_], Array, Array]:
    record, outcomes = record_of(setup, operator), np.zeros(stiffness.size, wall_tapping.OUTCOME)
    wall_tapping.cells(record.view(np.recarray), stiffness, damping, outcomes.view(np.recarray))
    return _assessment(setup, operator, outcomes), outcomes["energy_given"], outcomes["growth"]


def record_of(setup: Setup, operator: Operator) -> npt.NDArray[np.void]:
    """CELL record of one operator at this device."""
    record = np.zeros(1, wall_tapping.CELL)
    for name in setup._fields:
        record[name] = getattr(setup, name)
    for name in ("mass", "damping", "stiffness"):
        record[f"operator_{name}"] = getattr(operator, name)
    record["push"] = operator.push
    start = (0.0, 4 / 3, 0.0) if operator.pressed else (-2e-3, 0.0, 0.1)
    record["position"], record["depth"], record["velocity"] = start
    return record


def _assessment(setup: Setup, operator: Operator, outcomes: npt.NDArray[np.void]) -> npt.NDArray[np.int_]:
    """Shaking is energy of motion that grows or has grown, beyond two encoder steps; giving is more than there was."""
    begin = outcomes["beginning"]
    steps = 0.5 * (operator.stiffness + operator.push / 1e-3) * (2.0 * setup.resolution) ** 2
    moving = outcomes["vibration"] > SETTLED * begin + steps
    shaking = moving & ((outcomes["growth"] >= 1.0) | (outcomes["vibration"] > begin))
    giving = outcomes["energy_given"] > ROUNDING * begin + steps
    return np.where(shaking, SHAKING, np.where(giving, GIVING, QUIET))


def theory(setup: Setup, damping: Array, lateness: float = 0.0) -> dict[str, Array]:
    """Theoretical limits over the damping B [N s/m], {name: largest K [N/m] at each B}.

    The limits are `passive`, `stable` and, with a lateness, `late writes`. Raises ValueError for a value out of range.

    Args:
        setup: the device.
        damping: B [N s/m], (n).
        lateness: largest delay of writes [s], at most half a period; smaller delays occur too.

    Examples:
        >>> import numpy as np
        >>> from haptic_device.theory.zwidth import Setup, theory
        >>> lines = theory(Setup(0.1, 1.0, 0.001), np.array([0.0, 0.5]))
        >>> print(lines["passive"].round(3))  # 2 (b - B)/T
        [2000. 1000.]
    """
    check_setup(setup)
    within("lateness", lateness, 0.0, 0.5 * setup.period, "s")
    b, m, period = setup.physical_damping, setup.mass, setup.period
    loop = {"delay_samples": setup.delay_samples, "velocity_lag": setup.velocity_lag}
    lines = {
        "passive": [largest_passive_stiffness(b, float(B), period, **loop) for B in damping],
        "stable": [largest_stable_stiffness(m, b, float(B), period, **loop) for B in damping],
    }
    if lateness > 0.0:
        late = setup.delay_samples * period + lateness
        least = setup.delay_samples * period
        lines["late writes"] = [largest_stiffness(b, float(B), period, late, least) for B in damping]
    return {name: np.array(line) for name, line in lines.items()}
