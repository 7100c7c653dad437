"""Averaged spectra of a recording's beats, and a spectrogram of PD1."""

from dataclasses import dataclass

import numpy as np

from analysis.shot import Cancelled, Floats, Progress, Recording, Role, Stop
from instrument.live import CHANNEL_NAMES

BEATS = (Role.REFERENCE, Role.MEASUREMENT)
BINS = 4096
COLUMNS = 400


@dataclass(frozen=True, slots=True)
class Spectra:
    """One-sided power density of each beat against frequency, and PD1's also over time, in dB above 1 V^2/Hz."""

    frequency_hz: Floats  # (f,)
    power_db: dict[Role, Floats]  # each (f,)
    image_db: Floats  # (columns, rows) of PD1
    image_span_s: tuple[float, float]
    image_span_hz: tuple[float, float]
    power_span_db: tuple[float, float]  # range of the spectrum's axis
    image_levels_db: tuple[float, float]  # median and maximum of the image, for its colours


def spectra_of(recording: Recording, zero_s: float, report: Progress, cancelled: Stop) -> Spectra:
    """Return averaged Hann periodograms of the beats; cost: one pass of 4096-point FFTs over the record."""
    window = np.hanning(BINS)
    scale = 2.0 / (recording.sample_rate_hz * float(window @ window))  # 2: one-sided density
    count = recording.samples // BINS
    frequency = np.asarray(np.fft.rfftfreq(BINS, 1 / recording.sample_rate_hz), dtype=np.float64)
    power: dict[Role, Floats] = {}
    image = np.zeros((0, len(frequency)))
    pictured = recording.samples  # number of samples covered by the image
    for role in BEATS:
        column = recording.column(role)
        if column is None or count == 0:
            continue
        channel = recording.channels[column]
        total = np.zeros(len(frequency))
        rows: list[Floats] = []
        per_row = max(1, count // COLUMNS)
        for first in range(0, count - per_row + 1, per_row):
            if cancelled():
                raise Cancelled
            block = recording.counts[first * BINS : (first + per_row) * BINS, column].reshape(per_row, BINS)
            volts = np.asarray(block * channel.volts_per_count, dtype=np.float64)
            volts = volts - volts.mean(axis=1, keepdims=True)
            row = (np.abs(np.fft.rfft(volts * window, axis=1)) ** 2).mean(axis=0) * scale
            total += row
            rows.append(row)
            if first % (per_row * 16) == 0:
                report(f"spectrum of {CHANNEL_NAMES[role]}", first / count)
        power[role] = 10 * np.log10(total / max(1, len(rows)) + 1e-30)
        if role is Role.MEASUREMENT:
            image = 10 * np.log10(np.array(rows) + 1e-30)
            pictured = len(rows) * per_row * BINS
    centre = power.get(Role.REFERENCE, power.get(Role.MEASUREMENT))
    strongest = int(centre.argmax()) if centre is not None else 0
    reach = max(40, int(1.4e6 / (frequency[1] if len(frequency) > 1 else 1.0)))
    low, high = max(0, strongest - reach), min(len(frequency), strongest + reach)
    shown = image[:, low:high]
    highest = max((float(values[2:].max()) for values in power.values()), default=0.0)
    lowest = min((float(np.median(values)) for values in power.values()), default=-1.0)
    return Spectra(
        frequency,
        power,
        shown,
        (-zero_s, -zero_s + pictured / recording.sample_rate_hz),
        (float(frequency[low]), float(frequency[high - 1])) if len(frequency) else (0.0, 1.0),
        (lowest - 10, highest + 5),
        (float(np.median(shown)), float(shown.max())) if shown.size else (0.0, 1.0),
    )
