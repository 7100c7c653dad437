"""The noise of a displacement that the bench's beats allow, for those who score what an analysis made of it."""

import math

from instrument.bench.optics import Optics


def displacement_noise_m(optics: Optics, sample_rate_hz: float, record_rate_hz: float, *, both: bool = True) -> float:
    """Return the standard deviation of displacement at ``record_rate_hz``, decimated from ``sample_rate_hz``.

    Phase variance 1 / (N SNR) a beat over N averaged samples; ``both``: PD0 is taken off sample by sample.
    """
    averaged = sample_rate_hz / record_rate_hz
    variance = 10 ** (-optics.measurement_snr_db / 10) / averaged
    if both and optics.with_reference:
        variance += 10 ** (-optics.reference_snr_db / 10) / averaged
    return optics.wavelength_m / (4 * math.pi) * math.sqrt(variance)
