"""Digitizers for the window's tests: the simulated bench in a hurry, and ones that fail in a known way."""

import time

from instrument.bench.digitizer import BenchDigitizer
from instrument.devices.digitizer import Block, CaptureSettings, Digitizer, DigitizerError


def quick_bench(_: str) -> Digitizer:
    """Return a bench that pushes at once and never drops a sample."""
    return BenchDigitizer(patient=True, first_push_s=0.05, push_every_s=0.5)


def still_bench(_: str) -> Digitizer:
    """Return a bench whose block nobody pushes."""
    return BenchDigitizer(patient=True, push_every_s=0.0)


def idle_bench(_: str) -> Digitizer:
    """Return a still bench whose time runs so slowly that it costs no processor time, for tests of the session."""
    return BenchDigitizer(patient=True, push_every_s=0.0, clock=lambda: time.monotonic() / 50.0)


def no_device(_: str) -> Digitizer:
    """Refuse like a device that is not there."""
    raise DigitizerError("no Hantek 6022 found", "plug it in and choose it again")


class UnpluggedBench(BenchDigitizer):
    """A bench whose cable is pulled when told."""

    pulled = False

    def read_into(self, buffer, timeout_s) -> Block:
        """Fail once pulled."""
        if self.pulled:
            raise DigitizerError("the digitizer was unplugged", "plug it in, then arm again")
        return super().read_into(buffer, timeout_s)

    def arm(self, settings: CaptureSettings) -> None:
        """Work again once plugged in."""
        super().arm(settings)
