"""The interface of every digitizer: simulated bench, replay, USB streamer, oscilloscope, card."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Channel, Setup
from instrument.devices.ring import Ring
from instrument.files import one_line


class DigitizerError(Exception):
    """A device's fault, in one line, and its remedy."""

    def __init__(self, what: str, remedy: str = "") -> None:
        self.what = one_line(what, 400)  # messages of drivers and instruments may contain any characters
        self.remedy = one_line(remedy, 400)
        super().__init__(f"{self.what}: {self.remedy}" if remedy else self.what)

    def __reduce__(self) -> tuple[Any, ...]:  # a driver's subclass, too, reaches another process as this class
        return DigitizerError, (self.what, self.remedy)


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a device can do; rates in samples/s per channel."""

    name: str
    channels: tuple[Channel, ...]
    bits: int
    rates_hz: tuple[float, ...]  # the rates to offer; empty: only the rate set on the device
    max_samples: int | None  # per shot; None: unlimited stream
    hardware_trigger: bool  # True: the stream is one shot, already triggered
    real_time: bool  # True: samples are lost if they are not fetched in time
    unseen_loss_s: float = 0.0  # a loss shorter than this may go undetected
    simulated: bool = False  # True: it may be late on a busy computer, but neither hangs nor stalls


@dataclass(frozen=True, slots=True)
class CaptureSettings:
    """The requested sample rate and lengths of a shot; ``arm`` refuses settings that the device cannot do."""

    sample_rate_hz: float
    samples: int  # per channel, including the part before the trigger
    pre_trigger_samples: int


@dataclass(frozen=True, slots=True)
class Block:
    """The result of one ``read_into``; the samples are in the caller's buffer.

    ``lost_before`` is the number of samples per channel that the device lost before this block (None: unknown).  Losses
    are recorded as gaps and never filled.
    """

    samples: int
    lost_before: int | None = 0
    ended: bool = False  # no sample follows until the next ``arm``
    trigger_sample: int | None = None  # index in this block at which the hardware triggered, if in this block
    fired: bool = False  # in a block without samples: the hardware trigger fired, and its samples follow


_BLOCK_S = 0.04  # each block wakes a thread: shorter blocks cost more, longer ones are processed later
_BLOCK_SAMPLES = 256, 1 << 20  # limits of a block's size


def block_samples(sample_rate_hz: float) -> int:
    """Return the number of samples per channel that are read from a stream at a time."""
    least, most = _BLOCK_SAMPLES
    return max(least, min(most, int(_BLOCK_S * sample_rate_hz)))


class Digitizer(ABC):
    """A source of counts, used from one thread at a time; only ``stop`` may be called from any thread."""

    @property
    @abstractmethod
    def capabilities(self) -> Capabilities:
        """Get the device's capabilities."""

    @property
    @abstractmethod
    def setup(self) -> Setup:
        """Get what is known of the set-up from the device: everything for the bench, only bits for an oscilloscope."""

    def prepare(self) -> None:
        """Do the slow preparations for ``arm`` (compile, load firmware); called once, may take a minute."""
        return

    def default_settings(self) -> CaptureSettings | None:
        """Return the best settings for the next ``arm``; None if the device has no preference."""
        return None

    @abstractmethod
    def arm(self, settings: CaptureSettings) -> None:
        """Start sampling, or wait for the hardware trigger.  Raises DigitizerError."""

    def ring(self, capacity: int, settings: CaptureSettings, present: Ring | None) -> Ring:
        """Return a ring for a stream of these settings that holds ``capacity`` samples: ``present`` where it suits.

        Asked before ``arm``, by a reader that passes the ring's ``space`` to ``read_into``.  Raises DigitizerError.
        """
        channels = len(self.capabilities.channels)
        return present if present is not None and present.suits(capacity, channels) else Ring(capacity, channels)

    @abstractmethod
    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill the caller's ``buffer`` (int16, shape (n, channels)) from the front with up to n samples.

        Returns after at most ``timeout_s``, with ``samples`` 0 if none came.  Raises DigitizerError.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop sampling; a ``read_into`` in progress returns soon.  Harmless if not armed."""

    def close(self) -> None:
        """Release the device.  Harmless if already closed."""
        self.stop()


_RATE_HZ = 30e6
_SHOT_S = 1 / 6


def usual_settings(digitizer: Digitizer) -> CaptureSettings:
    """Return the settings of a shot that the operator has not specified.

    They are the digitizer's defaults, if any.  Otherwise: the fastest rate up to the paper's 30 MS/s, a sixth of a
    second (the paper's 5 M samples), and 1/16 of the shot before the trigger.  Raises DigitizerError without a rate.
    """
    own = digitizer.default_settings()
    able = digitizer.capabilities
    most = able.max_samples
    if own is not None:
        samples = min(own.samples, most or own.samples)
        return CaptureSettings(own.sample_rate_hz, samples, min(own.pre_trigger_samples, samples))
    rates = sorted(able.rates_hz)
    if not rates:
        raise DigitizerError(f"{able.name} states no sample rate", "give one")
    rate_hz = max((rate for rate in rates if rate <= _RATE_HZ), default=rates[0])
    samples = round(rate_hz * _SHOT_S)
    samples = min(samples, most or samples)
    return CaptureSettings(rate_hz, samples, samples // 16)
