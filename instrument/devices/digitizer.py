"""The one contract every digitizer honours: bench, replay, USB streamer, oscilloscope, card."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Channel, Setup
from instrument.files.recording_error import one_line


class DigitizerError(Exception):
    """What went wrong with a device, in one line, and what to do about it."""

    def __init__(self, what: str, remedy: str = "") -> None:
        self.what = one_line(what, 400)  # drivers and instruments put anything into their answers
        self.remedy = one_line(remedy, 400)
        super().__init__(f"{self.what}: {self.remedy}" if remedy else self.what)


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a device can do; rates in samples/s a channel."""

    name: str
    channels: tuple[Channel, ...]
    bits: int
    rates_hz: tuple[float, ...]  # the rates to offer; empty: only the device's own
    max_samples: int | None  # a shot; None: unlimited stream
    hardware_trigger: bool  # True: the stream is one shot, already triggered
    real_time: bool  # True: samples are lost when they are not fetched in time
    unseen_loss_s: float = 0.0  # a loss shorter than this may go unseen
    simulated: bool = False  # True: it waits for the processor alone; late it may be, but it neither hangs nor stalls


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """One shot as asked for; what a device cannot do is refused by ``arm`` with a DigitizerError."""

    sample_rate_hz: float
    samples: int  # a channel, pre-trigger part included
    pre_trigger_samples: int


@dataclass(frozen=True, slots=True)
class Block:
    """What one ``read_into`` delivered; the samples themselves are in the caller's buffer.

    ``lost_before`` counts samples a channel that the device dropped before the first one of this block (None: some,
    number unknown; they are recorded as a gap, never filled).  ``clipped`` counts samples at the rail, a channel.
    """

    samples: int
    lost_before: int | None = 0
    clipped: tuple[int, ...] = ()
    ended: bool = False  # nothing more comes until the next arm
    trigger_sample: int | None = None  # in this block, where the hardware found the trigger
    fired: bool = False  # with no samples yet: the hardware trigger fired, and from here on samples are due


class Digitizer(ABC):
    """A source of counts.  Used from one thread at a time; ``stop`` alone may be called from any thread."""

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """Get what the device can do."""

    @property
    @abstractmethod
    def setup(self) -> Setup:
        """Get what the device itself knows of the rig (bits; the bench knows all, a scope knows little)."""

    def prepare(self) -> None:
        """Do what takes long and need not wait for ``arm`` (compile, load firmware); called once, may take a minute."""
        return

    def default_settings(self) -> CaptureSettings | None:
        """Return the settings the next ``arm`` is best given; None where any of the capabilities will do."""
        return None

    @abstractmethod
    def arm(self, settings: CaptureSettings) -> None:
        """Start sampling, or wait for the hardware trigger.  Raises DigitizerError."""

    @abstractmethod
    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill ``buffer`` (int16, shape (n, channels), caller's own) from the front with up to n samples.

        Returns after at most ``timeout_s``, with ``samples`` 0 when nothing came.  Raises DigitizerError.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop sampling; a ``read_into`` under way returns soon.  Harmless when not armed."""

    def close(self) -> None:
        """Release the device.  Harmless when already closed."""
        self.stop()


_RATE_HZ = 30e6
_SHOT_S = 1 / 6


def usual_settings(digitizer: Digitizer, rate_hz: float | None = None, samples: int | None = None) -> CaptureSettings:
    """Return the settings of a shot for what the operator left open.

    They are the digitizer's defaults, else the fastest rate up to the paper's 30 MS/s, a sixth of a second (the paper's
    5 M samples), and a sixteenth of the shot before the trigger.  Raises DigitizerError if no rate is known.
    """
    own = digitizer.default_settings()
    able = digitizer.capabilities
    if rate_hz is None:
        rates = [own.sample_rate_hz] if own is not None else sorted(able.rates_hz)
        if not rates:
            raise DigitizerError(f"{able.name} states no sample rate", "give one")
        rate_hz = max((rate for rate in rates if rate <= _RATE_HZ), default=rates[0])
    if samples is None:
        samples = own.samples if own is not None else round(rate_hz * _SHOT_S)
        samples = min(samples, able.max_samples or samples)
    before = own.pre_trigger_samples if own is not None else samples // 16
    return CaptureSettings(rate_hz, samples, min(before, samples))
