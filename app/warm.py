"""Compile or load the kernels while the window opens, so that the first shot is as quick as the tenth."""

import numpy as np

from analysis.pipeline import analyse
from analysis.recording import Channel, Recording, Role, Setup
from analysis.shot import AnalysisSettings
from app.jobs import Asked, Report


def warm(report: Report, cancelled: Asked) -> None:
    """Run the whole road once over a few milliseconds of a plain beat; what comes out is thrown away."""
    report("preparing", 0.1)
    rate, samples = 10e6, 100_000
    phase = 2 * np.pi * 2.7e6 * np.arange(samples) / rate
    beat = np.round(8000 * np.cos(phase)).astype(np.int16)
    counts = np.stack((beat, beat), axis=1)
    channels = (Channel(Role.REFERENCE, 1e-4), Channel(Role.MEASUREMENT, 1e-4))
    analyse(Recording("warm-up", counts, rate, channels, Setup(0.01785)), AnalysisSettings(), cancelled=cancelled)
