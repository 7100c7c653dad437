"""Deep-memory oscilloscopes over SCPI: one shot on a hardware trigger, then its memory in chunks."""

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Channel, Role, Setup
from instrument.devices.digitizer import Block, Capabilities, CaptureSettings, Digitizer, DigitizerError
from instrument.devices.scpi_arming import EXTERNAL, RATE_TOLERANCE, HardwareTrigger, set_time, set_trigger
from instrument.devices.scpi_dialects import Dialect, Nonsense, Scaling, Timing, dialect_of
from instrument.devices.scpi_transport import Cancelled, ScpiTransport, Stalled
from instrument.devices.source_options import assumed_rig
from instrument.files.recording_error import one_line

POLL_S = 0.02
ARMING_S = 0.5  # for so long a "stopped" may still be that of the shot before

_ROLES: Mapping[int, Role] = {1: Role.REFERENCE, 2: Role.MEASUREMENT}


class ScpiOscilloscope(Digitizer):
    """An oscilloscope of the dialect table over any transport.

    ``roles`` says what its channels carry.  Ranges, coupling and, with ``trigger`` None, the trigger are taken as set
    on the instrument.  The scales are read when it is opened, when it is armed, and with the shot.
    """

    def __init__(
        self,
        link: ScpiTransport,
        roles: Mapping[int, Role] = _ROLES,
        trigger: HardwareTrigger | None = None,
        *,
        setup: Setup | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if Role.MEASUREMENT not in roles.values() or len(set(roles.values())) != len(roles):
            raise DigitizerError("one channel of the oscilloscope, and only one, must carry the measuring beat")
        self._link = link
        self._clock = clock
        self._roles = dict(sorted(roles.items()))
        self._trigger = trigger or HardwareTrigger()
        self._cancel = threading.Event()
        self._lock = threading.Lock()
        self._talk = threading.RLock()  # one exchange at a time: the fetching thread and whoever asks for settings
        self._worker: threading.Thread | None = None
        self._blocks: queue.SimpleQueue[_Piece | DigitizerError | None] = queue.SimpleQueue()
        self._piece: _Piece | None = None
        self._fetched = 0
        self._wanted = 0
        self._armed = False
        try:
            identity = link.query("*IDN?")
            self._dialect = dialect_of(identity)
            for command in self._dialect.begin:
                link.write(command)
        except DigitizerError:
            link.close()
            raise
        model = identity.split(",")[1].strip() if identity.count(",") else ""
        self._name = f"{self._dialect.name.split()[0]} {model}".strip()
        self._setup = setup or assumed_rig(self._dialect.bits)
        self._scales = {n: Scaling(1.0, 0.0) for n in self._roles}
        with contextlib.suppress(Nonsense):  # zeros before the first shot; refused once one is wanted
            self._read_scales_if_told()

    @property
    def capabilities(self) -> Capabilities:
        """Get what the instrument can do; scales are those read last."""
        return Capabilities(
            name=self._name,
            channels=tuple(
                Channel(role, self._scales[n].volts_per_count, self._scales[n].offset_v)
                for n, role in self._roles.items()
            ),
            bits=self._dialect.bits,
            rates_hz=(),
            max_samples=self._dialect.max_samples,
            hardware_trigger=True,
            real_time=False,
        )

    @property
    def setup(self) -> Setup:
        """Get the setup given; where none was, the paper's block is assumed and the setup says so."""
        return self._setup

    @property
    def progress(self) -> tuple[int, int]:
        """Get how many samples a channel have been fetched, of how many; (0, 0) while waiting for the trigger."""
        return self._fetched, self._wanted

    def default_settings(self) -> CaptureSettings:
        """Return what is set on the instrument: taking it as it is."""
        with self._talk:
            timing = self._dialect.set_now(self._link.query, next(iter(self._roles)))
        return CaptureSettings(timing.sample_rate_hz, timing.samples, timing.trigger_sample or 0)

    def arm(self, settings: CaptureSettings) -> None:
        """Set time base and memory where they are not as asked, and wait for the trigger.  Raises DigitizerError."""
        self.stop()
        if not 0 <= settings.pre_trigger_samples < settings.samples <= self._dialect.max_samples:
            raise DigitizerError(
                f"{self._name} cannot take {settings.samples} samples with {settings.pre_trigger_samples} before the "
                f"trigger",
                f"at most {self._dialect.max_samples}",
            )
        with self._talk:
            set_time(self._dialect, self._link.write, self.default_settings, settings, self._name)
            set_trigger(self._dialect, self._link.write, self._trigger)
            self._read_scales_if_told()
            for command in self._dialect.single:
                self._link.write(command)
        self._cancel.clear()
        self._blocks = queue.SimpleQueue()
        self._piece = None
        self._fetched = self._wanted = 0
        self._armed = True
        self._worker = threading.Thread(target=self._work, args=(settings, self._blocks), name="scpi", daemon=True)
        self._worker.start()

    def read_into(self, buffer: NDArray[np.int16], timeout_s: float) -> Block:
        """Fill ``buffer`` with what was fetched; nothing comes before the trigger."""
        if self._piece is None:
            if not self._armed:
                return Block(0, ended=True)
            try:
                item = self._blocks.get(timeout=max(timeout_s, 1e-3))
            except queue.Empty:
                return Block(0)
            if item is None or isinstance(item, DigitizerError):
                self._armed = False
                if item is not None:
                    raise item
                return Block(0, ended=True)
            self._piece = item
        piece = self._piece
        if not piece.counts.shape[0]:
            self._piece = None
            return Block(0, fired=True)
        count = min(piece.counts.shape[0], buffer.shape[0])
        buffer[:count] = piece.counts[:count]
        clipped: tuple[int, ...] = ()
        if self._dialect.bits == 8:
            rails = (buffer[:count] == -128) | (buffer[:count] == 127)
            clipped = tuple(int(n) for n in np.count_nonzero(rails, axis=0))
        at = piece.trigger_sample
        last = count == piece.counts.shape[0]
        block = Block(
            count,
            clipped=clipped,
            ended=last and piece.last,
            trigger_sample=at if at is not None and 0 <= at < count else None,
        )
        self._piece = None if last else _Piece(piece.counts[count:], None if at is None else at - count, piece.last)
        self._armed = self._armed and not block.ended
        return block

    def stop(self) -> None:
        """Give up waiting or fetching; from any thread."""
        self._cancel.set()
        with self._lock:
            worker, self._worker = self._worker, None
            if worker is not None:
                worker.join(timeout=15.0)

    def close(self) -> None:
        """Stop and let go of the instrument."""
        self.stop()
        self._link.close()

    def _read_scales_if_told(self) -> None:
        """Read the scales; some tell them only of a finished shot.  Raises Nonsense where they cannot be."""
        try:
            self._read_scales()
        except Nonsense:
            raise
        except DigitizerError:
            return

    def _read_scales(self) -> None:
        for n in self._roles:
            for command in self._dialect.select:
                self._link.write(command.format(n=n))
            self._scales[n] = self._dialect.scaling(self._link.query, n)

    def _work(self, settings: CaptureSettings, out: "queue.SimpleQueue[_Piece | DigitizerError | None]") -> None:
        """Wait for the trigger and fetch, in a thread of its own so that ``read_into`` keeps its time."""
        try:
            self._wait_for_shot()
            self._fetch(settings, out)
        except Cancelled:
            try:
                self._link.write(self._dialect.stop)
            except DigitizerError as error:
                out.put(error)
            out.put(None)
        except DigitizerError as error:
            out.put(error)
        except Exception as error:  # whoever waits for samples must hear of it
            out.put(DigitizerError(f"{self._name}: unexpected: {one_line(repr(error))}", "re-arm; report this"))

    def _wait_for_shot(self) -> None:
        armed_s = self._clock()
        seen_waiting = False
        while True:
            if self._cancel.wait(POLL_S):
                raise Cancelled
            with self._talk:
                done = self._dialect.is_done(self._link.query(self._dialect.status))
            seen_waiting = seen_waiting or not done
            if done and (seen_waiting or self._clock() - armed_s > ARMING_S):
                return

    def _fetch(self, settings: CaptureSettings, out: "queue.SimpleQueue[_Piece | DigitizerError | None]") -> None:
        words = self._dialect
        out.put(
            _Piece(np.empty((0, len(self._roles)), np.int16), None, False)
        )  # it fired: from here on samples are due
        with self._talk:
            with contextlib.suppress(Nonsense):  # those of the arming hold; the shot is worth more
                self._read_scales()
            timing = words.timing(self._link.query, next(iter(self._roles)))
        if abs(timing.sample_rate_hz / settings.sample_rate_hz - 1) > RATE_TOLERANCE:
            raise DigitizerError(
                f"{self._name} took {timing.sample_rate_hz:g} samples/s, not {settings.sample_rate_hz:g}", "re-arm"
            )
        first = max(0, (timing.trigger_sample or 0) - settings.pre_trigger_samples)
        end = min(timing.samples, first + settings.samples)
        self._wanted = end - first
        step = words.points_a_read or self._wanted
        for at in range(first, end, step):
            count = min(step, end - at)
            trigger = None if timing.trigger_sample is None else timing.trigger_sample - at
            counts = np.empty((count, len(self._roles)), np.int16)
            for column, n in enumerate(self._roles):
                try:
                    with self._talk:
                        counts[:, column] = self._points(n, at, count, timing)
                except Stalled as error:
                    if column == len(self._roles) - 1:  # of the rows before every channel is there: they are kept
                        came = words.decode(error.received)[at if words.points_a_read is None else 0 :][:count]
                        counts[: came.size, column] = came
                        self._fetched += came.size
                        out.put(_Piece(counts[: came.size], trigger, False))
                    raise
            self._fetched += count
            out.put(_Piece(counts, trigger, at + count == end))

    def _points(self, n: int, at: int, count: int, timing: Timing) -> NDArray[np.int16]:
        words = self._dialect
        whole = words.points_a_read is None
        for command in words.select:
            self._link.write(command.format(n=n))
        fetch = [f.format(n=n, a=at + 1, b=at + count, count=count, skip=at) for f in words.fetch]
        for command in fetch[:-1]:
            self._link.write(command)
        points = timing.samples if whole else count
        block = self._link.query_block(fetch[-1], points * words.bytes_per_sample, self._cancel.is_set)
        decoded = words.decode(block)
        decoded = decoded[at:] if whole else decoded
        if decoded.size < count:
            raise DigitizerError(f"{self._name} sent {decoded.size} of {count} samples of channel {n}", "re-arm")
        return decoded[:count]


@dataclass(frozen=True, slots=True)
class _Piece:
    """Fetched counts (int16, shape (n, channels)) and where in them the trigger is (may lie outside).

    One without counts says that the trigger fired.
    """

    counts: NDArray[np.int16]
    trigger_sample: int | None
    last: bool


__all__ = ["EXTERNAL", "Dialect", "HardwareTrigger", "ScpiOscilloscope"]
