"""Driver of deep-memory oscilloscopes over SCPI: one shot on a hardware trigger, fetched from memory in chunks."""

import contextlib
import math
import re
import threading
import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Channel, Role, Setup
from instrument.devices.digitizer import Capabilities, CaptureSettings, DigitizerError
from instrument.devices.scpi_dialects import ImplausibleAnswer, Scaling, Timing, dialect_of, one_two_five, short_depth
from instrument.devices.scpi_links import Cancelled, ScpiTransport, SocketTransport, Stalled, VisaTransport
from instrument.devices.source_options import SourceOptions
from instrument.devices.triggered_digitizer import HardwareTrigger, Piece, Pieces, TriggeredDigitizer
from instrument.files import one_line, shown

EXTERNAL = "external"
RATE_TOLERANCE = 1e-3
POLL_S = 0.02
ARMING_S = 0.5  # time after arming in which the status "stopped" may still refer to the previous shot

_ROLES: Mapping[int, Role] = {1: Role.REFERENCE, 2: Role.MEASUREMENT}


class ScpiOscilloscope(TriggeredDigitizer[int]):
    """An oscilloscope of the dialect table, over any transport.

    ``roles`` are the roles of its channels.  Ranges and coupling are as set on the instrument, and so is the trigger if
    ``trigger`` is None.  The scales are read on opening, on arming, and with the shot.
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
        super().__init__("oscilloscope", dict(sorted(roles.items())), setup)
        self._link = link
        self._clock = clock
        self._trigger = trigger or HardwareTrigger()
        self._exchange = threading.RLock()  # one exchange at a time, as the fetching thread also uses the link
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
        self._scales = {n: Scaling(1.0, 0.0) for n in self._roles}
        with contextlib.suppress(ImplausibleAnswer):  # zeros before the first shot, which ``arm`` refuses
            self._read_known_scales()

    @property
    def capabilities(self) -> Capabilities:
        """Get the instrument's capabilities; the scales are those read last."""
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

    def default_settings(self) -> CaptureSettings:
        with self._exchange:
            timing = self._dialect.set_now(self._link.query, next(iter(self._roles)))
        return CaptureSettings(timing.sample_rate_hz, timing.samples, timing.trigger_sample or 0)

    def arm(self, settings: CaptureSettings) -> None:
        """Set time base and trigger, then start one acquisition.

        Raises DigitizerError for settings that the instrument cannot do.
        """
        self.stop()
        if not 0 <= settings.pre_trigger_samples < settings.samples <= self._dialect.max_samples:
            raise DigitizerError(
                f"{self._name} cannot take {settings.samples} samples with {settings.pre_trigger_samples} before the "
                f"trigger",
                f"at most {self._dialect.max_samples}",
            )
        with self._exchange:
            self._set_time(settings)
            self._set_trigger()
            self._read_known_scales()
            for command in self._dialect.single:
                self._link.write(command)
        self._begin(settings)

    def close(self) -> None:
        self.stop()
        self._link.close()

    def _set_time(self, wanted: CaptureSettings) -> None:
        """Set time base, memory depth and trigger delay if they differ from ``wanted``.

        Raises DigitizerError if the instrument's rate still differs afterwards.
        """
        if self.default_settings() == wanted:
            return
        dialect, write = self._dialect, self._link.write
        length_s = wanted.samples / wanted.sample_rate_hz
        per_division = length_s / dialect.divisions
        if dialect.depths:
            per_division = one_two_five(per_division)
            needed = wanted.sample_rate_hz * per_division * dialect.divisions
            depth = min(dialect.depths, key=lambda candidate: abs(math.log(candidate / needed)))
            write(dialect.set_depth.format(samples=depth, short=short_depth(depth)))
        write(dialect.set_time_per_division.format(seconds=per_division))
        before_s = wanted.pre_trigger_samples / wanted.sample_rate_hz
        write(dialect.set_trigger_delay.format(seconds=length_s / 2 - before_s))  # centres the shot in the record
        now = self.default_settings()
        if abs(now.sample_rate_hz / wanted.sample_rate_hz - 1) > RATE_TOLERANCE:
            raise DigitizerError(
                f"{self._name} takes {now.sample_rate_hz:g} samples/s at this length, not {wanted.sample_rate_hz:g}",
                f"ask for {now.sample_rate_hz:g}, or set time base and memory depth on the instrument",
            )

    def _set_trigger(self) -> None:
        """Set the trigger, unless the instrument's own setting is to be used."""
        dialect, trigger = self._dialect, self._trigger
        if trigger.source is None:
            return
        external = trigger.source == EXTERNAL
        commands = [*(dialect.trigger_external if external else dialect.trigger_channel), dialect.slope[trigger.slope]]
        if trigger.level_v is not None:
            commands.append(dialect.level)
        source = "EX" if external else f"C{trigger.source}"
        for command in commands:
            self._link.write(command.format(n=trigger.source, source=source, volts=trigger.level_v))

    def _read_known_scales(self) -> None:
        """Read the scales, which some instruments know only after a shot.  Raises ImplausibleAnswer."""
        try:
            self._read_scales()
        except DigitizerError as error:
            if isinstance(error, ImplausibleAnswer):
                raise

    def _read_scales(self) -> None:
        for n in self._roles:
            for command in self._dialect.select:
                self._link.write(command.format(n=n))
            self._scales[n] = self._dialect.scaling(self._link.query, n)

    def _take_shot(self, settings: CaptureSettings, out: Pieces) -> None:
        try:
            self._wait_for_shot()
            self._fetch(settings, out)
        except Cancelled:
            try:
                self._link.write(self._dialect.stop)
            except DigitizerError as error:
                out.put(error)
            out.put(None)

    def _described(self, error: Exception) -> DigitizerError:
        return DigitizerError(f"{self._name}: unexpected: {one_line(repr(error))}", "re-arm; report this")

    def _wait_for_shot(self) -> None:
        armed_s = self._clock()
        seen_waiting = False
        while True:
            if self._cancel.wait(POLL_S):
                raise Cancelled
            with self._exchange:
                done = self._dialect.is_done(self._link.query(self._dialect.status))
            seen_waiting = seen_waiting or not done
            if done and (seen_waiting or self._clock() - armed_s > ARMING_S):
                return

    def _fetch(self, settings: CaptureSettings, out: Pieces) -> None:
        dialect = self._dialect
        out.put(Piece(np.empty((0, len(self._roles)), np.int16), None, False))  # reports that the trigger fired
        with self._exchange:
            with contextlib.suppress(ImplausibleAnswer):  # the scales read on arming are then used
                self._read_scales()
            timing = dialect.timing(self._link.query, next(iter(self._roles)))
        if abs(timing.sample_rate_hz / settings.sample_rate_hz - 1) > RATE_TOLERANCE:
            raise DigitizerError(
                f"{self._name} took {timing.sample_rate_hz:g} samples/s, not {settings.sample_rate_hz:g}", "re-arm"
            )
        first = max(0, (timing.trigger_sample or 0) - settings.pre_trigger_samples)
        end = min(timing.samples, first + settings.samples)
        step = dialect.points_per_read or end
        for at in range(first, end, step):
            count = min(step, end - at)
            trigger = None if timing.trigger_sample is None else timing.trigger_sample - at
            counts = np.empty((count, len(self._roles)), np.int16)
            for column, n in enumerate(self._roles):
                try:
                    with self._exchange:
                        counts[:, column] = self._points(n, at, count, timing)
                except Stalled as error:
                    if column == len(self._roles) - 1:  # keep the rows received for all channels
                        skipped = at if dialect.points_per_read is None else 0
                        received = dialect.decode(error.received)[skipped:][:count]
                        counts[: received.size, column] = received
                        out.put(Piece(counts[: received.size], trigger, False))
                    raise
            out.put(Piece(counts, trigger, at + count == end))

    def _points(self, n: int, at: int, count: int, timing: Timing) -> NDArray[np.int16]:
        dialect = self._dialect
        whole = dialect.points_per_read is None
        for command in dialect.select:
            self._link.write(command.format(n=n))
        fetch = [f.format(n=n, a=at + 1, b=at + count, count=count, skip=at) for f in dialect.fetch]
        for command in fetch[:-1]:
            self._link.write(command)
        points = timing.samples if whole else count
        block = self._link.query_block(fetch[-1], points * dialect.bytes_per_sample, self._cancel.is_set)
        decoded = dialect.decode(block)
        decoded = decoded[at:] if whole else decoded
        if decoded.size < count:
            raise DigitizerError(f"{self._name} sent {decoded.size} of {count} samples of channel {n}", "re-arm")
        return decoded[:count]


_USB_ADDRESS = re.compile(r"usb(?::([0-9a-f]{4}):([0-9a-f]{4}))?", re.IGNORECASE)
_HOST = re.compile(r"(\[[0-9a-fA-F:.]{2,45}\]|[A-Za-z0-9](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?)(?::(\d{1,5}))?")
_VISA = re.compile(r"[A-Za-z0-9]+(?:::[A-Za-z0-9._,\[\]:-]+)+")
_OPTIONS = re.compile(r"[A-Za-z]+=[^\s&?]+(?:&[A-Za-z]+=[^\s&?]+)*")
_REMEDY = "type HOST or HOST:PORT, as 192.168.1.5 or scope.lab:5025, or a VISA name; options as ?trigger=3 may follow"


def network_source(typed: str) -> str:
    """Return the source text of an address typed by the operator.  Raises DigitizerError for text that is none."""
    text = typed.strip()
    text = text[5:] if text.lower().startswith("scpi:") else text
    address, question_mark, options = text.partition("?")
    if not (_host_of(address) or _VISA.fullmatch(address)):
        raise DigitizerError(f"{shown(text)} is no address" if text else "no address was given", _REMEDY)
    if address.lower() == "usb":
        raise DigitizerError("an oscilloscope on USB is found by itself", "plug it in and look again")
    if question_mark and not _OPTIONS.fullmatch(options):
        raise DigitizerError(f"{shown(options)} are no options", _REMEDY)
    return f"scpi:{text}"


def _host_of(address: str) -> tuple[str, int | None] | None:
    """Return host and port (None: try the usual ports) of ``HOST[:PORT]``; None if ``address`` has another form."""
    host = _HOST.fullmatch(address)
    port = int(host[2]) if host and host[2] else None
    return (host[1], port) if host and (port is None or 0 < port < 65536) else None


def network_name(source: str) -> str:
    """Return the name shown on the screen for a source of ``network_source``."""
    return f"Oscilloscope at {source.removeprefix('scpi:').partition('?')[0]}"


def open_digitizer(address: str, options: SourceOptions) -> ScpiOscilloscope:
    """Open the oscilloscope at an address: ``usb[:VVVV:PPPP]``, ``HOST[:PORT]`` or a VISA resource name."""
    roles = options.assigned(options.wholes("channels", "1,2", "channel"))
    source: int | str | None = None
    if "trigger" in options:
        source = EXTERNAL if options.text("trigger", "") == EXTERNAL else options.whole("trigger", "")
    trigger = HardwareTrigger(source, options.slope(), options.number("level", "") if "level" in options else None)
    rig = options.rig()  # all options are read before the instrument is opened
    return ScpiOscilloscope(_link(address), roles, trigger, setup=rig)


def _link(address: str) -> ScpiTransport:
    if usb_address := _USB_ADDRESS.fullmatch(address):
        from instrument.devices.usbtmc import UsbtmcTransport, find_instruments

        wanted = tuple(int(part, 16) for part in usb_address.groups() if part)
        devices = [d for d in find_instruments() if not wanted or (d.idVendor, d.idProduct) == wanted]
        if not devices:
            raise DigitizerError(f"no oscilloscope at {address}", "plug it in, and set its USB device port to USBTMC")
        return UsbtmcTransport(devices[0])
    if "::" in address and not address.startswith("["):
        return VisaTransport(address)
    if found := _host_of(address):
        host, port = found
        return SocketTransport(host.strip("[]"), port)
    raise DigitizerError(
        f"{shown(address)} is no address of an oscilloscope", "give HOST, HOST:PORT, usb or a VISA resource name"
    )
