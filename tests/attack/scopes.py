"""Oscilloscopes that flood, stall, lie, trickle, hang up: a shot is whole, kept as far as it came, or refused."""

import random
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from instrument.capture.capture import AcquireError, acquire
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.scpi import ScpiOscilloscope
from instrument.devices.scpi_links import SocketTransport
from instrument.files.recording_file import read_recording
from instrument.files.recording_search import find_recordings
from tests.attack.trial import SURVIVED, Attempt, refused_in_a_line
from tests.instrument.devices.scpi_emulator import EmulatedScope, TcpScope

ANSWERS_S, BLOCK_S = 0.4, 0.6  # instead of 5 and 10 s, so that hundreds can be tried
LONGEST_S = 15.0
SAMPLES, RATE_HZ, BEFORE = 60_000, 1e7, 6_000


class Hasty(SocketTransport):
    """The driver's own transport, with less patience."""

    def query(self, command: str, timeout_s: float = ANSWERS_S) -> str:
        """Ask, waiting less."""
        return super().query(command, min(timeout_s, ANSWERS_S))

    def query_block(self, command: str, max_bytes: int, cancelled: Callable[[], bool] = lambda: False,
                    timeout_s: float = BLOCK_S) -> bytes:  # fmt: skip
        """Ask, waiting less."""
        return super().query_block(command, max_bytes, cancelled, min(timeout_s, BLOCK_S))


@dataclass
class Mischief:
    """What is done instead of the answer to the ``at``-th command that has one, and to every later one of its kind."""

    kind: str
    at: int
    share: float = 0.5


FLOODS = {"newlines": b"\n" * 4096, "blanks": b"\r\n" * 2048, "digits": b"9" * 4096, "zeros": b"\0" * 4096}
LIES = {
    "zero": b"0\n", "zeros": b"0,0,0,0,0,0,0,0,0,0\n", "huge": b"1e300\n", "huge fields": b",".join([b"1e300"] * 10),
    "tiny": b"1e-310,1e-310,1e-310,1e-310,1e-310,1e-310,1e-310,1e-310,1e-310,1e-310\n", "nan": b"nan\n",
    "infinite": b"9.9E+37\n", "negative": b"-1,-1,-1,-1,-1,-1,-1,-1,-1,-1\n", "empty": b"\n",
    "words": b"COMMAND ERROR\n",
    "digits": b"9" * 400 + b"\n", "escape": b"\x1b[2J\x1b]0;owned\x07\n", "not ascii": b"\xff\xfe\x00\n",
    "fractions": b"0.5\n", "ones": b"1,1,1,1,1,1,1,1,1,1\n",
}  # fmt: skip
HEADS = {
    "longer than asked": b"#9999999999", "no digits": b"#A12", "zero digits": b"#0", "cut": b"#",
    "negative": b"#3-10", "none": b"x" * 200, "empty": b"#10\n",
}  # fmt: skip
KINDS = (
    *(f"flood of {name}" for name in FLOODS), *(f"lie: {name}" for name in LIES), *(f"head: {name}" for name in HEADS),
    "silence", "stall", "trickle", "hang up", "half and hang up", "twice", "late",
)  # fmt: skip


class RogueScope(TcpScope):
    """An emulated oscilloscope that misbehaves once, in the middle of its talk."""

    def __init__(self, scope: EmulatedScope, mischief: Mischief) -> None:
        self.mischief = mischief
        self.answered = 0
        super().__init__(scope)

    def _talk(self, link: socket.socket) -> None:
        link.settimeout(0.05)
        waiting = b""
        while not self._closing.is_set():
            try:
                received = link.recv(4096)
            except TimeoutError:
                continue
            if not received:
                return
            waiting += received
            while b"\n" in waiting:
                line, _, waiting = waiting.partition(b"\n")
                answer = self.scope.answer(line.decode("ascii", "replace"))
                if answer is None:
                    continue
                self.answered += 1
                if self.answered != self.mischief.at:
                    link.settimeout(2.0)
                    link.sendall(answer)
                    link.settimeout(0.05)
                elif not self._misbehave(link, answer):
                    return

    def _misbehave(self, link: socket.socket, answer: bytes) -> bool:
        """Do it; return whether the connection stays."""
        kind, _, what = self.mischief.kind.partition(": ")
        cut = int(self.mischief.share * len(answer))
        if kind.startswith("flood of "):
            while not self._closing.is_set():
                link.sendall(FLOODS[kind.removeprefix("flood of ")])
        elif kind == "lie":
            link.sendall(LIES[what])
        elif kind == "head":
            link.sendall(HEADS[what])
        elif kind == "stall":
            link.sendall(answer[:cut])
        elif kind == "trickle":
            for byte in answer:
                link.sendall(bytes([byte]))
                if self._closing.wait(0.05):
                    break
        elif kind == "half and hang up":
            link.sendall(answer[:cut])
            return False
        elif kind == "hang up":
            return False
        elif kind == "twice":
            link.sendall(answer + answer)
        elif kind == "late":
            self._closing.wait(2 * ANSWERS_S)
            link.sendall(answer)
        return True


def scopes(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Try each kind of mischief with each maker at each of the first 40 answers, in a random order."""
    cases = [(maker, kind, at) for maker in ("rigol", "siglent", "keysight") for kind in KINDS for at in range(1, 41)]
    random_.shuffle(cases)
    for number, (maker, kind, at) in enumerate(cases):
        mischief = Mischief(kind, at, random_.random())

        def attempt(number: int = number, maker: str = maker, mischief: Mischief = mischief) -> str:
            return take_shot(folder / str(number), maker, mischief)

        yield f"{maker}, {kind}, answer {at}", attempt


def take_shot(folder: Path, maker: str, mischief: Mischief) -> str:
    """Take one shot from a rogue; what was recorded must open, and what was not must be told in one line."""
    begun = time.monotonic()
    with RogueScope(EmulatedScope(maker), mischief) as server:
        try:
            scope = ScpiOscilloscope(Hasty("127.0.0.1", server.port, 1.0))
            acquire(scope, folder, 1, CaptureSettings(RATE_HZ, SAMPLES, BEFORE), timeout_s=3.0)
        except (AcquireError, DigitizerError) as error:
            ended = refused_in_a_line(str(error))
        else:
            ended = SURVIVED
    spent = time.monotonic() - begun
    assert spent < LONGEST_S, f"took {spent:.0f} s"
    for path in find_recordings([folder]) if any(folder.glob("*.sigmf-*")) else ():
        shot = read_recording(path)
        assert all(channel.volts_per_count for channel in shot.channels) and shot.samples > 0
    return ended
