# SPDX-License-Identifier: Apache-2.0
"""Finds an oscillation in a force: a narrow line of its spectrum, in whichever half seconds it stands out."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import signal

from haptic_device.theory.quantity import Array, within

WINDOW = 0.5  # [s] of one spectrum
LOWEST = 15.0  # [Hz]; below it is the hand
SLOWEST = 50.0  # [Hz] rate of a force whose spectrum has lines above LOWEST
STANDS_OUT = 100.0  # times the median of its neighbourhood; noise reaches 25 once in an hour
LEAST_FORCE = 0.02  # [N] RMS; a hand does not feel less
_NEIGHBOURS = 2.0 ** np.array([-1.0, 1.0])
PIECE = 100  # segments computed at a time
_KNOWN = 0.02  # of a known frequency, to either side
_LINE = 2  # bins to either side that belong to a line (Hann window)


class Oscillation(NamedTuple):
    """The strongest line of a force's spectrum.

    Attributes:
        frequency: [Hz].
        force: RMS of the force where the line is strongest [N].
        begin: when it begins [s].
        seconds: how long it lasts [s].

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.oscillation import spectrum_of
        >>> time = np.arange(0.0, 2.0, 0.001)
        >>> force = np.sin(2.0 * np.pi * 100.0 * time)[:, None]  # 100 Hz, amplitude 1 N
        >>> found = spectrum_of(force, 1000.0).oscillation
        >>> round(found.frequency), round(found.force, 2)  # RMS 1/√2 N
        (100, 0.71)
    """

    frequency: float
    force: float
    begin: float
    seconds: float


class Spectrum(NamedTuple):
    """Spectrum of a force.

    Attributes:
        frequency: [Hz], (frequencies).
        density: power density over the whole time [N²/Hz], (frequencies).
        oscillation: the strongest line, or None.

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.oscillation import spectrum_of
        >>> found = spectrum_of(np.zeros((2000, 2)), 1000.0)
        >>> found.frequency.shape == found.density.shape, found.oscillation
        (True, None)
    """

    frequency: npt.NDArray[np.floating]
    density: npt.NDArray[np.floating]
    oscillation: Oscillation | None


def too_short(samples: int, rate: float) -> str:
    """That so many samples at this rate [Hz] are too few for a spectrum, a sentence; "" if they are enough."""
    if not rate >= SLOWEST:
        return f"ticks at {rate:.3g} Hz are too few for a spectrum; {SLOWEST:g} Hz are needed"
    if samples >= int(WINDOW * rate):
        return ""
    return f"a force of {samples / rate:.2g} s is too short for a spectrum; {WINDOW} s are needed"


def spectrum_of(force: Array, rate: float, known: float = 0.0) -> Spectrum:
    """Spectrum of a force, all axes together.

    Samples that are not finite count as 0. Raises ValueError if the force is shorter than one window, has no axis, or
    has a rate too low for frequencies above LOWEST.

    Args:
        force: [N], (samples, axes).
        rate: samples a second [Hz].
        known: frequency [Hz] whose multiples are no oscillation, such as that of the exchange.

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.oscillation import spectrum_of
        >>> time = np.arange(0.0, 2.0, 0.001)
        >>> print(spectrum_of(np.sin(time)[:, None], 1000.0).oscillation)  # the motion of a hand is none
        None
    """
    within("rate", rate, SLOWEST, np.inf, "Hz")
    if np.ndim(force) != 2 or not np.size(force, 1):
        raise ValueError(f"a force of shape {np.shape(force)} has no spectrum; (samples, axes) is needed")
    length = int(WINDOW * rate)
    if said := too_short(len(force), rate):
        raise ValueError(said)
    step = length // 2 * PIECE  # long forces piece by piece: their spectra alone would need more memory than they
    starts = range(0, len(force) - length + 1, step)
    pieces = [_densities(force[at : at + step + length // 2], rate, length) for at in starts]
    densities = np.concatenate(pieces, axis=1)
    frequency, begins = np.fft.rfftfreq(length, 1.0 / rate), np.arange(densities.shape[1]) * (length // 2) / rate
    return Spectrum(frequency, densities.mean(axis=1), _strongest(frequency, densities, begins, known))


def _densities(force: Array, rate: float, length: int) -> npt.NDArray[np.float32]:
    """Power density (frequency, segment) of all axes together; the segments overlap by half."""
    density = np.zeros(1)
    for column in force.T:
        finite = np.nan_to_num(column, nan=0.0, posinf=0.0, neginf=0.0)
        density = density + signal.spectrogram(finite, rate, "hann", length, length - length // 2, detrend="linear")[2]
    return density.astype(np.float32)


def _strongest(
    frequency: npt.NDArray[np.floating],
    densities: npt.NDArray[np.float32],
    begins: npt.NDArray[np.floating],
    known: float,
) -> Oscillation | None:
    """The line with the largest force that stands out of its neighbourhood."""
    lines = _lines(frequency, densities, known)
    step = frequency[1] - frequency[0]
    found = {segment: line for segment, line in lines.items() if line[1] >= LEAST_FORCE}
    if not found:
        return None
    best = max(found, key=lambda segment: found[segment][1])
    line, force = found[best]
    same = [segment for segment, (other, _) in found.items() if abs(other - line) <= 3 * step]
    return Oscillation(float(line), float(force), float(begins[min(same)]), len(same) * WINDOW / 2)


def _lines(
    frequency: npt.NDArray[np.floating], densities: npt.NDArray[np.float32], known: float
) -> dict[int, tuple[float, float]]:
    """(frequency, RMS) of the line in each segment that has one."""
    step, found = frequency[1] - frequency[0], {}
    high = int(0.45 * 2 * len(frequency))
    first = int(np.ceil(LOWEST / step))
    weight = frequency[first:high, None] ** 2
    if known > 0.0:
        multiple = np.maximum(1.0, np.round(frequency[first:high] / known)) * known
        weight[np.abs(frequency[first:high] - multiple) < _KNOWN * multiple] = 0.0
    peaks = first + np.argmax(densities[first:high] * weight, axis=0)
    for segment, peak in enumerate(peaks):
        low, up = np.clip((peak * _NEIGHBOURS).astype(int), 1, len(frequency) - 1)
        around = densities[low : up + 1, segment]
        if densities[peak, segment] > STANDS_OUT * np.median(around) > 0.0:
            power = densities[max(0, peak - _LINE) : peak + _LINE + 1, segment].sum() * step
            centre = np.average(frequency[peak - 1 : peak + 2], weights=densities[peak - 1 : peak + 2, segment])
            found[segment] = float(centre), float(np.sqrt(power))
    return found
