"""A digitizer being read into the ring: what came, what was lost, whether the light switch fired."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import DEFAULT_WAVELENGTH_AIR_M, Role, Setup
from instrument.capture.capture_options import CaptureOptions
from instrument.capture.motion_trigger import MotionTrigger
from instrument.capture.ring import Ring, Stream
from instrument.capture.trigger import Level, LightSwitch, TriggerSettings
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError

READ_TIMEOUT_S = 0.05
STALL_S = 3.0  # without a sample from a running stream: the device has stopped
_BLOCK_S = 0.01
_BLOCKS = 256, 1 << 18  # least and most samples a read
_HELD_S = 0.5  # of the stream, for those who read behind
_MOST_RING_BYTES = 512 * 2**20
MOST_SHOT_BYTES = 2 * 2**30


@dataclass(frozen=True, slots=True)
class Piece:
    """One block in the ring; ``counts`` is valid until the next read.  ``step`` is the trigger's index in it."""

    counts: NDArray[np.int16]
    first: int  # ring number of its first sample
    lost_before: int | None
    step: int | None
    ended: bool
    fired: bool = False  # the device's own trigger; its samples are yet to come


class SourceRun:
    """Reads one digitizer; used from the capture thread.

    ``stream``, ``switch_level``, ``toggles`` and ``thresholds_v`` are for any thread.
    """

    def __init__(self, digitizer: Digitizer, clock: Callable[[], float] = time.monotonic) -> None:
        self._digitizer = digitizer
        self._clock = clock
        self._ring: Ring | None = None
        self._switch: LightSwitch | None = None
        self._motion: MotionTrigger | None = None
        self._came_s = 0.0
        self._delivered: DeliveredRate | None = None  # of a stream that runs with the clock
        self._block = 0
        self._reading: tuple[object, ...] = ()
        self.stream: Stream | None = None
        self.running = False
        self.starting = False  # which may take a while
        self.simulated = False
        self.hardware_trigger = False
        self.endless = False  # streams on after a shot

    @property
    def switch_level(self) -> Level:
        """Get the side the light switch is on."""
        return self._switch.level if self._switch is not None else Level.UNKNOWN

    @property
    def toggles(self) -> int:
        """Get how often the light switch changed since the stream began."""
        return self._switch.toggles if self._switch is not None else 0

    @property
    def thresholds_v(self) -> tuple[float | None, float | None]:
        """Get the low and the high threshold of the light switch in V as they are now, set or learned.

        None where there is none: the device has its own trigger, or the level on that side is not known.
        """
        switch, stream = self._switch, self.stream
        if switch is None or stream is None or self.hardware_trigger:
            return None, None
        channel = next((one for one in stream.channels if one.role is Role.SWITCH), None)
        if channel is None:
            return None, None
        low, high = (
            None if counts is None else counts * channel.volts_per_count + channel.offset_v
            for counts in switch.thresholds_counts
        )
        return (low, high) if channel.volts_per_count > 0 else (high, low)

    def continues(self, settings: CaptureSettings, options: CaptureOptions) -> bool:
        """Return whether the running stream serves these choices too, so that nothing has to be restarted."""
        stream = self.stream
        return (
            self.running
            and stream is not None
            and self.endless
            and _reading(options) == self._reading
            and stream.settings.sample_rate_hz == settings.sample_rate_hz
            and self._ring is not None
            and settings.pre_trigger_samples + 2 * self._block <= self._ring.capacity
        )

    def start(self, settings: CaptureSettings, options: CaptureOptions) -> None:
        """Arm the digitizer and begin a new stream.  Raises DigitizerError."""
        self.stop()
        able = self._digitizer.capabilities
        check_settings(settings, len(able.channels))
        check_channels(able)
        own = self._digitizer.setup
        self._block = int(np.clip(_BLOCK_S * settings.sample_rate_hz, *_BLOCKS))
        self._make_ring(settings, len(able.channels))
        assert self._ring is not None
        self._switch = None
        self._motion = None if able.hardware_trigger else _motion_trigger(able, settings, options, options.setup or own)
        for column, channel in enumerate(able.channels):
            if channel.role is Role.SWITCH:
                try:
                    how = TriggerSettings.in_volts(options.edge, options.switch_low_v, options.switch_high_v, channel)
                except ValueError as error:
                    raise DigitizerError(str(error), "correct the trigger settings") from None
                self._switch, self._motion = LightSwitch(how, column, able.bits), None
        self._reading = _reading(options)
        self.simulated = able.simulated
        self.starting = True
        try:
            self._digitizer.arm(settings)
        finally:
            self.starting = False
        setup = _with_bits(options.setup or own, able.bits)
        self.stream = Stream(
            self._ring, self._ring.total, settings, able.channels, setup, able.name, able.unseen_loss_s
        )
        self.hardware_trigger = able.hardware_trigger
        self.endless = able.max_samples is None and not able.hardware_trigger
        self._delivered = (
            DeliveredRate(settings.sample_rate_hz) if able.real_time and self.endless and not able.simulated else None
        )
        self.running = True
        self._came_s = self._clock()

    def read(self) -> Piece | None:
        """Return the next piece, None where nothing came in time.  Raises DigitizerError."""
        ring, stream = self._ring, self.stream
        assert ring is not None and stream is not None
        view = ring.space(self._block)
        block = self._digitizer.read_into(view, READ_TIMEOUT_S)
        _check_block(block, view.shape[0])
        now = self._clock()
        if block.fired and block.samples == 0:
            ring.commit(0)
            return Piece(view[:0], ring.total, 0, None, block.ended, fired=True)
        if block.samples == 0 and not block.ended:
            ring.commit(0)
            if now < self._came_s:
                self._came_s = now  # a clock that ran backwards must not hide a stall for long
            if not self.hardware_trigger and not self.simulated and now - self._came_s > STALL_S:
                raise self._stalled()
            return None
        self._came_s = now
        first = ring.total
        if block.lost_before != 0 and block.samples > 0:
            stream.note_loss(first, block.lost_before)
        ring.commit(block.samples)
        if self._delivered is not None:
            self._delivered.add(block.samples, block.lost_before, now, waits=block.samples == len(view))
            stream.doubtful_rate_hz = self._delivered.doubtful_hz
        counts = view[: block.samples]
        trigger = self._switch or self._motion
        step = trigger.first_step(counts) if trigger is not None else None
        if block.trigger_sample is not None or self.hardware_trigger:
            step = block.trigger_sample
        if block.ended:
            self.running = False
        return Piece(counts, first, block.lost_before, step, block.ended)

    def switch_words(self) -> str:
        """Return what the light switch did so far, where it never stepped; "" where it did or there is none."""
        switch = self._switch
        if switch is None or switch.toggles:
            return ""
        if switch.moved_counts is None:
            return "the light switch never crossed its thresholds"
        return f"the light switch moved by {switch.moved_counts:.0f} counts, a step takes {switch.needed_counts:.0f}"

    def _stalled(self) -> DigitizerError:
        assert self.stream is not None and self._ring is not None
        came = self._ring.total - self.stream.start
        if not came:
            return DigitizerError(f"no samples came for {STALL_S:g} s", "check the device and its cable")
        switch = self.switch_words()
        what = f"{came} samples came, then none for {STALL_S:g} s" + (f"; {switch}" if switch else "")
        part = "light switch, its channel and its thresholds" if switch else "device and its cable"
        return DigitizerError(what, f"check the {part}")

    def stop(self) -> None:
        """Stop the digitizer; the last stream stays to be looked at."""
        self.running = False
        self._digitizer.stop()

    def _make_ring(self, settings: CaptureSettings, channels: int) -> None:
        held = max(round(_HELD_S * settings.sample_rate_hz), 16 * self._block)
        most = max(_MOST_RING_BYTES // (2 * channels), settings.pre_trigger_samples + 8 * self._block)
        blocks = -(-min(settings.pre_trigger_samples + held, most) // self._block)
        capacity = blocks * self._block
        ring = self._ring
        if ring is None or ring.channels != channels or ring.capacity < capacity or ring.capacity > 4 * capacity:
            self._ring = Ring(capacity, channels)


def _reading(options: CaptureOptions) -> tuple[object, ...]:
    return (
        options.setup, options.edge, options.switch_low_v, options.switch_high_v, options.trigger_speed_m_per_s,
    )  # fmt: skip


def _motion_trigger(
    able: Capabilities, settings: CaptureSettings, options: CaptureOptions, setup: Setup
) -> MotionTrigger | None:
    columns = {channel.role: column for column, channel in enumerate(able.channels)}
    speed = options.trigger_speed_m_per_s
    if speed is None or Role.MEASUREMENT not in columns:
        return None
    if not 0 < speed < 100:
        raise DigitizerError(f"a trigger speed of {speed:g} m/s", "choose one the block can reach")
    wavelength_m = setup.wavelength_air_m or setup.wavelength_vacuum_m or DEFAULT_WAVELENGTH_AIR_M
    return MotionTrigger(
        columns[Role.MEASUREMENT], columns.get(Role.REFERENCE), settings.sample_rate_hz, wavelength_m, speed,
        setup.rest_frequency_hz,
    )  # fmt: skip


def check_settings(settings: CaptureSettings, channels: int) -> None:
    """Refuse, as a DigitizerError, settings that no shot can be taken with."""
    rate = settings.sample_rate_hz
    if not (0 < rate <= 1e12):
        raise DigitizerError(f"sample rate of {rate:g} Hz", "choose one of the digitizer's rates")
    if settings.samples < 1 or not 0 <= settings.pre_trigger_samples <= settings.samples:
        raise DigitizerError(
            f"a shot of {settings.samples} samples, {settings.pre_trigger_samples} of them before the trigger",
            "correct the lengths",
        )
    if 2 * channels * settings.samples > MOST_SHOT_BYTES:
        raise DigitizerError(
            f"a shot of {settings.samples} samples in {channels} channels takes more than "
            f"{MOST_SHOT_BYTES // 2**30} GiB of memory",
            "choose a shorter shot or a lower rate",
        )


def check_channels(able: Capabilities) -> None:
    """Refuse, as a DigitizerError, channels whose scale no recording can hold."""
    for channel in able.channels:
        if not (1e-30 < abs(channel.volts_per_count) < 1e6 and abs(channel.offset_v) < 1e9):
            raise DigitizerError(
                f"{able.name} tells {channel.volts_per_count:g} V a count and an offset of {channel.offset_v:g} V",
                "set the vertical scale anew, then arm again",
            )


def _check_block(block: Block, room: int) -> None:
    wrong = not 0 <= block.samples <= room
    wrong |= block.lost_before is not None and block.lost_before < 0
    wrong |= block.trigger_sample is not None and not 0 <= block.trigger_sample < max(1, block.samples)
    if wrong:
        raise DigitizerError("the digitizer sent nonsense", "stop it, re-plug it, and report this if it happens again")


def _with_bits(setup: Setup, bits: int) -> Setup:
    return setup if setup.digitizer_bits == bits else replace(setup, digitizer_bits=bits)


LEAST_S = 1.0  # of stream
LATE_S = 0.3  # by which a device and its driver may be late or early
OFF = 5e-4  # of the rate: what neither a crystal nor the computer's clock is off by


@dataclass(slots=True)
class DeliveredRate:
    """Counts what a stream of ``stated_hz`` brings; ``doubtful_hz`` is what came instead, None while that agrees."""

    stated_hz: float
    doubtful_hz: float | None = None
    _begun_s: float | None = None
    _samples: int = 0

    def add(self, samples: int, lost: int | None, now_s: float, *, waits: bool) -> None:
        """Take a block that came at ``now_s``, so many samples lost before it (None: nobody knows, it begins anew).

        Where more ``waits`` to be fetched nothing is said: the computer is late then, not the device.
        """
        if lost is None or self._begun_s is None or now_s < self._begun_s:
            self._begun_s, self._samples = now_s, 0
            return
        self._samples += samples + lost
        passed_s = now_s - self._begun_s
        if waits or passed_s < LEAST_S:
            return
        off_s = abs(self._samples / self.stated_hz - passed_s)
        self.doubtful_hz = self._samples / passed_s if off_s > LATE_S + OFF * passed_s else None
