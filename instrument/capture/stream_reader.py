"""Puts blocks of a digitizer into the ring; counts losses, finds the trigger, checks the sample rate."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.shot import DEFAULT_WAVELENGTH_AIR_M, Role, Setup
from instrument.devices import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError, Ring, block_samples
from instrument.live import DeliveredRate, Stream
from instrument.trigger import Edge, Level, LightSwitch, MotionTrigger, TriggerSettings

READ_TIMEOUT_S = 0.05
STALL_S = 3.0  # without a sample, after which a running device counts as stopped
TRIGGER_SPEED_M_PER_S = 0.05  # of the block, for the trigger without a light switch
_GLANCE_S = 2e-5  # between the samples of the light switch that are read while only its level matters
_RING_S = 0.5  # of the stream that the ring holds, for slow readers
_MAX_RING_BYTES = 512 * 2**20
_MAX_SHOT_BYTES = 2 * 2**30


@dataclass(frozen=True, slots=True)
class CaptureOptions:
    """How shots are taken.  The folder must exist.

    ``settings`` None: ``usual_settings`` of the digitizer; ``setup`` None: the digitizer's own.  The thresholds of the
    light switch are in V; None: learned from the signal.
    """

    folder: Path
    settings: CaptureSettings | None = None
    setup: Setup | None = None
    edge: Edge = Edge.EITHER
    switch_low_v: float | None = None
    switch_high_v: float | None = None


@dataclass(frozen=True, slots=True)
class ReadBlock:
    """One block in the ring; ``counts`` is valid until the next read.  ``step`` is the trigger's index in it."""

    counts: NDArray[np.int16]
    first: int  # ring number of its first sample
    lost_before: int | None
    step: int | None
    ended: bool
    fired: bool = False  # the device's own trigger fired; its samples follow


class StreamReader:
    """Reads one digitizer, from the capture thread.

    ``stream``, ``switch_level``, ``toggles`` and ``thresholds_v`` are for any thread.
    """

    def __init__(self, digitizer: Digitizer, clock: Callable[[], float] = time.monotonic) -> None:
        self._digitizer = digitizer
        self._clock = clock
        self._switch: LightSwitch | None = None
        self._motion: MotionTrigger | None = None
        self._received_s: float  # time of the last samples
        self._delivered: DeliveredRate | None = None  # for a real-time stream only
        self._block: int  # samples read at a time
        self._options: tuple[object, ...] = ()
        self.stream: Stream | None = None
        self.running = False
        self.starting = False  # the device is being armed, which may take a while
        self.simulated = False
        self.hardware_trigger = False
        self.endless = False  # the stream goes on after a shot

    @property
    def switch_level(self) -> Level:
        """Get the level of the light switch."""
        return self._switch.level if self._switch is not None else Level.UNKNOWN

    @property
    def toggles(self) -> int:
        """Get the number of changes of the light switch since the stream began."""
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
        """Return whether the running stream can be used with these settings, without a restart."""
        stream = self.stream
        return (
            self.running
            and stream is not None
            and self.endless
            and _stream_options(options) == self._options
            and stream.settings.sample_rate_hz == settings.sample_rate_hz
            and settings.pre_trigger_samples + 2 * self._block <= stream.ring.capacity
        )

    def start(self, settings: CaptureSettings, options: CaptureOptions) -> None:
        """Arm the digitizer and begin a new stream.  Raises DigitizerError."""
        self.stop()
        able = self._digitizer.capabilities
        check_settings(settings, len(able.channels))
        _check_channels(able)
        own = self._digitizer.setup
        self._block = block_samples(settings.sample_rate_hz)
        ring = self._ring_for(settings, len(able.channels))
        self._switch = None
        self._motion = None if able.hardware_trigger else _motion_trigger(able, settings, options.setup or own)
        for column, channel in enumerate(able.channels):
            if channel.role is Role.SWITCH:
                try:
                    trigger = TriggerSettings.in_volts(
                        options.edge, options.switch_low_v, options.switch_high_v, channel
                    )
                except ValueError as error:
                    raise DigitizerError(str(error), "correct the trigger settings") from None
                self._switch, self._motion = LightSwitch(trigger, column, able.bits), None
        self._options = _stream_options(options)
        self.simulated = able.simulated
        self.starting = True
        try:
            self._digitizer.arm(settings)
        finally:
            self.starting = False
        setup = replace(options.setup or own, digitizer_bits=able.bits)
        self.stream = Stream(ring, ring.total, settings, able.channels, setup, able.name, able.unseen_loss_s)
        self.hardware_trigger = able.hardware_trigger
        self.endless = able.max_samples is None and not able.hardware_trigger
        self._delivered = (
            DeliveredRate(settings.sample_rate_hz) if able.real_time and self.endless and not able.simulated else None
        )
        self.running = True
        self._received_s = self._clock()

    def read(self, *, closely: bool = True) -> ReadBlock | None:
        """Read the next block into the ring and return it, None if none came in time.  Raises DigitizerError.

        A shot's trigger is sought only if ``closely``.  Otherwise the light switch is read now and then, for its level:
        reading each sample takes half of the capture thread's time.
        """
        stream = self.stream
        assert stream is not None
        ring = stream.ring
        view = ring.space(self._block)
        block = self._digitizer.read_into(view, READ_TIMEOUT_S)
        _check_block(block, view.shape[0])
        now, first = self._clock(), ring.total
        if block.lost_before != 0 and block.samples > 0:
            stream.note_loss(first, block.lost_before)
        ring.commit(block.samples)
        if block.samples == 0 and not block.ended and not block.fired:
            if not self.hardware_trigger and not self.simulated and now - self._received_s > STALL_S:
                raise self._stalled()
            return None
        self._received_s = now
        if self._delivered is not None:
            self._delivered.add(block.samples, block.lost_before, now, waits=block.samples == len(view))
            stream.doubtful_rate_hz = self._delivered.doubtful_hz
        counts = view[: block.samples]
        step = self._step(block, counts, closely)
        if block.ended:
            self.running = False
        return ReadBlock(counts, first, block.lost_before, step, block.ended, block.fired and not block.samples)

    def _step(self, block: Block, counts: NDArray[np.int16], closely: bool) -> int | None:
        """Return the trigger's index in the counts: by the device if it has a trigger, else by switch or motion."""
        if self._switch is not None and not closely:
            assert self.stream is not None
            self._switch.first_step(counts[:: max(1, int(_GLANCE_S * self.stream.settings.sample_rate_hz))])
            return block.trigger_sample
        trigger = self._switch or self._motion
        step = trigger.first_step(counts) if trigger is not None else None  # asked of all counts, as it keeps track
        by_device = block.trigger_sample is not None or self.hardware_trigger
        return block.trigger_sample if by_device else step

    def why_no_step(self) -> str:
        """Return why the light switch has not stepped so far; "" if it has, or if there is none."""
        switch = self._switch
        if switch is None or switch.toggles:
            return ""
        if switch.moved_counts is None:
            return "the light switch never crossed its thresholds"
        return f"the light switch moved by {switch.moved_counts:.0f} counts, a step takes {switch.needed_counts:.0f}"

    def _stalled(self) -> DigitizerError:
        assert self.stream is not None
        came = self.stream.ring.total - self.stream.start
        if not came:
            return DigitizerError(f"no samples came for {STALL_S:g} s", "check the device and its cable")
        switch = self.why_no_step()
        what = f"{came} samples came, then none for {STALL_S:g} s" + (f"; {switch}" if switch else "")
        part = "light switch, its channel and its thresholds" if switch else "device and its cable"
        return DigitizerError(what, f"check the {part}")

    def stop(self) -> None:
        """Stop the digitizer; the last stream stays readable."""
        self.running = False
        self._digitizer.stop()

    def _ring_for(self, settings: CaptureSettings, channels: int) -> Ring:
        """Return the last stream's ring if its size suits these settings, else a new one."""
        lag = max(round(_RING_S * settings.sample_rate_hz), 12 * self._block)
        most = max(_MAX_RING_BYTES // (2 * channels), settings.pre_trigger_samples + 8 * self._block)
        blocks = -(-min(settings.pre_trigger_samples + lag, most) // self._block)
        present = self.stream.ring if self.stream is not None else None
        return self._digitizer.ring(blocks * self._block, settings, present)


def check_settings(settings: CaptureSettings, channels: int) -> None:
    """Raise DigitizerError for settings with which no shot can be taken."""
    rate = settings.sample_rate_hz
    if not (0 < rate <= 1e12):
        raise DigitizerError(f"sample rate of {rate:g} Hz", "choose one of the digitizer's rates")
    if settings.samples < 1 or not 0 <= settings.pre_trigger_samples <= settings.samples:
        raise DigitizerError(
            f"a shot of {settings.samples} samples, {settings.pre_trigger_samples} of them before the trigger",
            "correct the lengths",
        )
    if 2 * channels * settings.samples > _MAX_SHOT_BYTES:
        raise DigitizerError(
            f"a shot of {settings.samples} samples in {channels} channels takes more than "
            f"{_MAX_SHOT_BYTES // 2**30} GiB of memory",
            "choose a shorter shot or a lower rate",
        )


def _check_channels(able: Capabilities) -> None:
    """Raise DigitizerError for channels whose scale no recording can store."""
    for channel in able.channels:
        if not (1e-30 < abs(channel.volts_per_count) < 1e6 and abs(channel.offset_v) < 1e9):
            raise DigitizerError(
                f"{able.name} reports {channel.volts_per_count:g} V per count and an offset of {channel.offset_v:g} V",
                "set the vertical scale anew, then arm again",
            )


def _stream_options(options: CaptureOptions) -> tuple[object, ...]:
    """Return the options that take effect when a stream starts."""
    return options.setup, options.edge, options.switch_low_v, options.switch_high_v


def _motion_trigger(able: Capabilities, settings: CaptureSettings, setup: Setup) -> MotionTrigger | None:
    """Return the motion trigger, for a device with neither a light switch nor its own trigger."""
    columns = {channel.role: column for column, channel in enumerate(able.channels)}
    if Role.MEASUREMENT not in columns:
        return None
    wavelength_m = setup.wavelength_air_m or setup.wavelength_vacuum_m or DEFAULT_WAVELENGTH_AIR_M
    return MotionTrigger(
        columns[Role.MEASUREMENT], columns.get(Role.REFERENCE), settings.sample_rate_hz, wavelength_m,
        TRIGGER_SPEED_M_PER_S, setup.rest_frequency_hz,
    )  # fmt: skip


def _check_block(block: Block, room: int) -> None:
    wrong = not 0 <= block.samples <= room
    wrong |= block.lost_before is not None and block.lost_before < 0
    wrong |= block.trigger_sample is not None and not 0 <= block.trigger_sample < max(1, block.samples)
    if wrong:
        raise DigitizerError("the digitizer sent nonsense", "stop it, re-plug it, and report this if it happens again")
