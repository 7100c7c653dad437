"""Oscilloscopes of the three makers, as far as the driver talks to them; over TCP or any carrier of messages.

Waveform: channel n's volts are a ramp of its own, quantised as the maker does it; ``volts(n)`` gives them.
"""

import socket
import threading
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np


@dataclass
class EmulatedScope:
    """State and words of an oscilloscope; ``answer`` takes one command line."""

    maker: str  # "rigol", "siglent", "keysight"
    samples: int = 60_000
    rate_hz: float = 1e7
    trigger_at: int = 6_000
    polls_until_trigger: int = 3
    log: list[str] = field(default_factory=list)
    garbage: dict[str, bytes] = field(default_factory=dict)
    stopped: bool = True
    _source: int = 1
    _start: int = 1
    _stop: int = 1
    _polls: int = 0
    _delay: float | None = None

    IDENTITY: ClassVar = {
        "rigol": "RIGOL TECHNOLOGIES,DS1104Z,DS1ZA0,00.04.04",
        "siglent": "Siglent Technologies,SDS1104X-E,SDSMM,8.2.6.1.37R9",
        "keysight": "KEYSIGHT TECHNOLOGIES,DSO-X 3024T,MY0,07.30",
    }
    VDIV, OFFSET, YINC = 0.5, 0.25, 0.02

    def codes(self, n: int) -> np.ndarray:
        ramp = (np.arange(self.samples) * (2 * n + 1)) % 251
        if self.maker == "siglent":
            return (ramp - 125).astype(np.int8)
        if self.maker == "keysight":
            return ((ramp - 125) * 100).astype("<i2")
        return ramp.astype(np.uint8)

    def volts(self, n: int) -> np.ndarray:
        codes = self.codes(n).astype(float)
        if self.maker == "siglent":
            return codes * self.VDIV / 25 - self.OFFSET
        if self.maker == "keysight":
            return (codes - 7) * 1e-4 + 0.3
        return (codes - 10 - 127) * self.YINC

    @property
    def delay_s(self) -> float:
        return (self.samples / 2 - self.trigger_at) / self.rate_hz if self._delay is None else self._delay

    def answer(self, line: str) -> bytes | None:
        self.log.append(line)
        if line in self.garbage:
            return self.garbage[line]
        if line == "*IDN?":
            return self.IDENTITY[self.maker].encode() + b"\n"
        return getattr(self, f"_{self.maker}")(line)

    def _single(self) -> None:
        self.stopped = False
        self._polls = 0

    def _poll(self) -> bool:
        if not self.stopped:
            self._polls += 1
            self.stopped = self._polls > self.polls_until_trigger
        return self.stopped

    def _set_span(self, record_s: float) -> None:
        self.rate_hz = self.samples / record_s

    def _set_delay(self, seconds: float) -> None:
        self._delay = seconds
        self.trigger_at = round(self.samples / 2 - seconds * self.rate_hz)

    @staticmethod
    def _block(content: bytes, tail: bytes = b"\n") -> bytes:
        return b"#9%09d" % len(content) + content + tail

    def _preamble(self, kind: str) -> bytes:
        step = 1 / self.rate_hz
        origin = -self.trigger_at * step
        vertical = (f"{self.YINC},10,127") if self.maker == "rigol" else "1.0E-04,0.3,7"
        return f"{kind},{self.samples},1,{step:e},{origin:e},0,{vertical}\n".encode()

    def _rigol(self, line: str) -> bytes | None:
        word, _, value = line.partition(" ")
        if word == ":SING":
            self._single()
        elif word == ":STOP":
            self.stopped = True
        elif word == ":WAV:SOUR":
            self._source = int(value.removeprefix("CHAN"))
        elif word == ":WAV:STAR":
            self._start = int(value)
        elif word == ":WAV:STOP":
            self._stop = int(value)
            assert self._stop - self._start < 250_000
        elif word == ":ACQ:MDEP":
            self.samples = int(value)
        elif word == ":TIM:MAIN:SCAL":
            self._set_span(12 * float(value))
        elif word == ":TIM:MAIN:OFFS":
            self._set_delay(float(value))
        return {
            ":TRIG:STAT?": lambda: b"STOP\n" if self._poll() else b"WAIT\n",
            ":ACQ:SRAT?": lambda: b"%e\n" % self.rate_hz,
            ":ACQ:MDEP?": lambda: b"%d\n" % self.samples,
            ":TIM:MAIN:OFFS?": lambda: b"%e\n" % self.delay_s,
            ":WAV:PRE?": lambda: self._preamble("0,2"),
            ":WAV:DATA?": lambda: self._block(self.codes(self._source)[self._start - 1 : self._stop].tobytes()),
        }.get(word, lambda: None)()

    def _siglent(self, line: str) -> bytes | None:
        if line == "ARM":
            self._single()
        elif line == "STOP":
            self.stopped = True
        elif line.startswith("MSIZ "):
            self.samples = int(line[5:].replace("K", "000").replace("M", "000000"))
        elif line.startswith("TDIV "):
            self._set_span(14 * float(line[5:].removesuffix("S")))
        elif line.startswith("TRDL "):
            self._set_delay(float(line[5:].removesuffix("S")))
        elif line.startswith("WFSU "):
            numbers = line.removeprefix("WFSU ").split(",")
            assert numbers[:2] == ["SP", "1"]
            self._start, self._stop = int(numbers[5]), int(numbers[3])
        elif line.endswith(":WF? DAT2"):
            n = int(line[1])
            return b"DAT2," + self._block(self.codes(n)[self._start : self._start + self._stop].tobytes(), b"\n\n")
        if line[:-1] == "SANU? C":
            return b"%.2fkpts\n" % (self.samples / 1e3)
        return {
            "SAST?": lambda: b"Stop\n" if self._poll() else b"Ready\n",
            "SARA?": lambda: b"%.2eSa/s\n" % self.rate_hz,
            "TRDL?": lambda: b"%e\n" % self.delay_s,
            "C1:VDIV?": lambda: b"%.2E\n" % self.VDIV,
            "C2:VDIV?": lambda: b"%.2E\n" % self.VDIV,
            "C1:OFST?": lambda: b"%.2EV\n" % self.OFFSET,
            "C2:OFST?": lambda: b"%.2EV\n" % self.OFFSET,
        }.get(line, lambda: None)()

    def _keysight(self, line: str) -> bytes | None:
        word, _, value = line.partition(" ")
        if word == ":SING":
            self._single()
        elif word == ":STOP":
            self.stopped = True
        elif word == ":WAV:SOUR":
            self._source = int(value.removeprefix("CHAN"))
        elif word == ":TIM:SCAL":
            self.samples = round(self.rate_hz * 10 * float(value))
        elif word == ":TIM:POS":
            self._set_delay(float(value))
        return {
            ":OPER:COND?": lambda: b"+0\n" if self._poll() else b"+40\n",
            ":ACQ:SRAT?": lambda: b"%e\n" % self.rate_hz,
            ":TIM:RANG?": lambda: b"%e\n" % (self.samples / self.rate_hz),
            ":TIM:POS?": lambda: b"%e\n" % self.delay_s,
            ":WAV:PRE?": lambda: self._preamble("1,0"),
            ":WAV:DATA?": lambda: self._block(self.codes(self._source).tobytes()),
        }.get(word, lambda: None)()


class TcpScope:
    """An EmulatedScope behind a loopback socket; ``pace_bytes`` slows a block down to be cancelled."""

    def __init__(self, scope: EmulatedScope, pieces: tuple[int, float] | None = None) -> None:
        self.scope = scope
        self.pieces = pieces
        self.drop_at: str | None = None
        self.connections = 0
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._listener.close()
        self._thread.join(timeout=5)

    def __enter__(self) -> "TcpScope":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _serve(self) -> None:
        self._listener.settimeout(0.05)
        while not self._closing.is_set():
            try:
                link, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            self.connections += 1
            with link:
                try:
                    self._talk(link)
                except OSError:
                    continue

    def _talk(self, link: socket.socket) -> None:
        waiting = b""
        while True:
            closing = self._closing.is_set()
            link.settimeout(0.0 if closing else 0.05)  # what was sent before the end is still read
            try:
                received = link.recv(4096)
            except (TimeoutError, BlockingIOError):
                if closing:
                    return
                continue
            if not received:
                return
            waiting += received
            while b"\n" in waiting:
                line, _, waiting = waiting.partition(b"\n")
                if self.drop_at == line.decode():
                    return
                answer = self.scope.answer(line.decode())
                if answer is None:
                    continue
                size, pause = self.pieces or (len(answer), 0.0)
                for at in range(0, len(answer), size):
                    link.sendall(answer[at : at + size])
                    if self._closing.wait(pause):
                        return
