"""Convert the bytes of a two-channel 8-bit streamer to counts, and cut the stream where samples were lost."""

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from instrument.devices.bulk_stream import Chunk
from instrument.devices.digitizer import Block
from instrument.devices.packet_losses import PacketLossFinder

PACKET_BYTES = 512
SETTLING_PACKETS = 8  # discarded packets (2048 samples per channel) in which the input settles
_UNDECIDED_PACKETS = 2  # last packets for which only later packets decide whether samples were lost before them
_SAME_LOSS_S = 2.5  # longest delay between detection of one loss by the beat and by the clock


class StreamedCodes:
    """The stream from chunks received (``accept``) to samples delivered (``deliver``).

    ``reference_column`` is the channel (0 or 1) with the rest beat, whose phase reveals lost packets.  If None, only
    the byte clock does, later and for larger losses only.
    """

    def __init__(self, bytes_per_s: float, reference_column: int | None) -> None:
        self._column = reference_column
        self._clock = ByteClock(bytes_per_s)
        self._seams = PacketLossFinder(PACKET_BYTES // 2)
        self._ready: deque[tuple[NDArray[np.uint8], bool]] = deque()
        self._undecided = np.empty(0, np.uint8)
        self._part = np.empty(0, np.uint8)  # an incomplete packet
        self._lost = False  # True: samples are missing before the undecided packets
        self._settling = SETTLING_PACKETS * PACKET_BYTES
        self._loss_seen_s = -math.inf

    @property
    def ready(self) -> bool:
        """Get whether ``deliver`` has samples."""
        return bool(self._ready)

    def accept(self, chunk: Chunk) -> None:
        """Add a chunk's bytes and find the losses in them."""
        lost = chunk.lost_before
        behind = self._clock.count(chunk.codes.size, chunk.received_s)
        if behind and chunk.received_s - self._loss_seen_s > _SAME_LOSS_S:
            lost = True
        if lost:
            self._loss_seen_s = chunk.received_s
            self.flush()
            self._lost = True
        codes = np.concatenate((self._part, chunk.codes)) if self._part.size else chunk.codes
        if self._settling:
            skipped = min(self._settling, codes.size)
            self._settling -= skipped
            codes = codes[skipped:]
        whole = codes.size // PACKET_BYTES * PACKET_BYTES
        self._part, codes = codes[whole:], codes[:whole]
        seams = [] if self._column is None else self._seams.find(codes[self._column :: 2])
        if seams:
            self._loss_seen_s = chunk.received_s
        cuts = [seam * PACKET_BYTES + self._undecided.size for seam in seams]
        joined = np.concatenate((self._undecided, codes)) if self._undecided.size else codes
        settled = max(0, joined.size - _UNDECIDED_PACKETS * PACKET_BYTES)
        start = 0
        for cut in (*cuts, settled):
            if start < cut <= settled:
                self._ready.append((joined[start:cut], self._lost))
                self._lost = False
                start = cut
            self._lost = self._lost or cut in cuts
        self._undecided = joined[settled:]

    def flush(self) -> None:
        """Make the undecided packets ready, whole samples only, because the stream does not continue after them."""
        rest = np.concatenate((self._undecided, self._part))
        rest = rest[: rest.size // 2 * 2]
        if rest.size:
            self._ready.append((rest, self._lost))
            self._lost = False
        self._undecided = self._part = np.empty(0, np.uint8)
        self._seams.forget()

    def deliver(self, buffer: NDArray[np.int16]) -> Block:
        """Fill ``buffer`` (shape (n, 2)) from the front with codes minus 128; stop before the next loss."""
        filled = 0
        lost_before = bool(self._ready) and self._ready[0][1]
        while self._ready and filled < buffer.shape[0]:
            codes, lost = self._ready[0]
            if lost and filled:
                break
            count = min(codes.size // 2, buffer.shape[0] - filled)
            pairs = codes[: 2 * count].reshape(count, 2)
            np.subtract(pairs, 128, out=buffer[filled : filled + count], dtype=np.int16)
            filled += count
            self._ready.popleft()
            if 2 * count < codes.size:
                self._ready.appendleft((codes[2 * count :], False))
        return Block(filled, lost_before=None if lost_before else 0)


DRIFT = 300e-6  # largest relative deviation of two crystals' frequencies
SHORT_WINDOW_S, SHORT_STEP_S = 0.3, 0.03
LONG_WINDOW_S, LONG_STEP_S = 2.0, 0.004


class ByteClock:
    """Compares the bytes received with ``bytes_per_s`` times the time elapsed."""

    def __init__(self, bytes_per_s: float) -> None:
        self._rate = bytes_per_s
        self._recent: deque[tuple[float, float]] = deque()  # (time, lag) in s
        self._received: int | None = None  # bytes since the first chunk
        self._level_s: float | None = None  # the lag without a loss
        self._judged_s: float

    def count(self, received_bytes: int, now_s: float) -> int:
        """Count a chunk that arrived at ``now_s``; return the number of lost bytes detected, usually 0.

        A loss of more than 30 ms of data is detected after 0.3 s, a loss of more than 4 ms after 2 s.
        """
        if self._received is None:
            self._received = 0
            return 0  # the first chunk only starts the clock, as the time to fill it is unknown
        self._received += received_bytes
        self._recent.append((now_s, now_s - self._received / self._rate))
        while self._recent[0][0] < now_s - LONG_WINDOW_S:
            self._recent.popleft()
        if len(self._recent) < 4:
            return 0
        soon_s = min(lag for at, lag in self._recent if at >= now_s - SHORT_WINDOW_S)
        if self._level_s is None:
            self._level_s, self._judged_s = soon_s, now_s
            return 0
        creep_s = DRIFT * (now_s - self._judged_s)
        self._judged_s = now_s
        lasting_s = min(lag for _, lag in self._recent)
        for lag_s, step_s in ((soon_s, SHORT_STEP_S), (lasting_s, LONG_STEP_S)):
            if lag_s - self._level_s > step_s + creep_s:
                lost = round((lag_s - self._level_s) * self._rate)
                self._level_s = lag_s
                return lost
        behind_s = soon_s - self._level_s
        self._level_s += behind_s if behind_s < -LONG_STEP_S else max(-creep_s, min(creep_s, behind_s))
        return 0
