from .cross_talk import CROSS_TALK_LEFT
from .demodulation import demodulate
from .filters import MAX_BANDWIDTH_SHARE, derivative_filters, derivative_gains, derivatives, first_run, stretches
from .noise import MIN_NOISE_M, white_noise
from .record import motion_from_displacement
from .stream import LiveChunk, LiveDemodulator

__all__ = [
    "CROSS_TALK_LEFT",
    "MAX_BANDWIDTH_SHARE",
    "MIN_NOISE_M",
    "LiveChunk",
    "LiveDemodulator",
    "demodulate",
    "derivative_filters",
    "derivative_gains",
    "derivatives",
    "first_run",
    "motion_from_displacement",
    "stretches",
    "white_noise",
]
