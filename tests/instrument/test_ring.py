"""The ring: readers get the samples that were written, never partly replaced ones."""

import threading

import numpy as np
import pytest

from analysis.shot.recording import Setup
from instrument.devices.digitizer import CaptureSettings
from instrument.devices.ring import Overwritten, Ring
from instrument.live.stream import Stream
from tests.instrument.capturing import append


def numbered(start: int, length: int, channels: int = 2) -> np.ndarray:
    """Return samples that carry their own number."""
    return np.repeat((np.arange(start, start + length) % 30_000).astype(np.int16)[:, None], channels, axis=1)


def test_any_cutting_gives_the_same_samples() -> None:
    rng = np.random.default_rng(1)
    ring = Ring(97, 2)
    total = 0
    for _ in range(300):
        length = int(rng.integers(0, 150))
        append(ring, numbered(total, length))
        total += length
        assert ring.total == total and ring.oldest == max(0, total - 97)
        start = int(rng.integers(ring.oldest, total + 1))
        out = np.empty((total - start, 2), np.int16)
        ring.copy_into(start, out)
        np.testing.assert_array_equal(out, numbered(start, total - start))


def test_what_is_gone_or_not_yet_there_is_said() -> None:
    ring = Ring(10, 1)
    append(ring, numbered(0, 25, 1))
    with pytest.raises(Overwritten):
        ring.copy_into(14, np.empty((2, 1), np.int16))
    with pytest.raises(ValueError, match="of 25"):
        ring.copy_into(20, np.empty((6, 1), np.int16))
    ring.space(3)  # samples that are being replaced count as gone before they are
    with pytest.raises(Overwritten):
        ring.copy_into(15, np.empty((2, 1), np.int16))
    with pytest.raises(ValueError, match="claimed"):
        ring.commit(4)


def test_a_reader_never_sees_a_sample_half_replaced() -> None:
    ring = Ring(4_096, 2)
    done = threading.Event()

    def write() -> None:
        at = 0
        while not done.is_set():
            append(ring, numbered(at, 512))
            at += 512

    writer = threading.Thread(target=write)
    writer.start()
    out = np.empty((2_048, 2), np.int16)
    seen = 0
    try:
        while seen < 300:
            start = ring.total - 3_000
            if start < 0:
                continue
            try:
                ring.copy_into(start, out)
            except Overwritten:
                continue
            np.testing.assert_array_equal(out, numbered(start, 2_048))
            seen += 1
    finally:
        done.set()
        writer.join()


def test_losses_are_counted_together_and_those_that_left_the_ring_are_forgotten() -> None:
    ring = Ring(1000, 1)
    stream = Stream(ring, 0, CaptureSettings(1e6, 500, 10), (), Setup(17.85e-3), "bench")
    for number in range(1, 101):
        append(ring, numbered(0, 50, 1))
        stream.note_loss(ring.total, None if number % 10 == 0 else number)
    assert stream.losses == 100 and stream.lost == sum(n for n in range(1, 101) if n % 10)
    assert stream.gaps[-1] == (5000, None) and stream.gaps[-2] == (4950, 99)
    assert [at for at, _ in stream.gaps] == list(range(ring.oldest, 5001, 50))


def test_losses_whose_size_is_unknown_are_forgotten_as_the_others_however_many_there_are() -> None:
    """A stream that loses samples for hours, and cannot say how many, neither stops nor grows."""
    ring = Ring(1000, 1)
    stream = Stream(ring, 0, CaptureSettings(1e6, 500, 10), (), Setup(17.85e-3), "bench")
    for _ in range(300):
        append(ring, numbered(0, 50, 1))
        stream.note_loss(ring.total, None)
        assert len(stream.gaps) <= 1000 / 50 + 1
    assert (stream.losses, stream.lost) == (300, 0)
    assert {at for at, _ in stream.gaps} >= set(range(ring.oldest, ring.total + 1, 50))


def test_what_the_writer_replaces_during_the_copy_is_said() -> None:
    ring = Ring(10, 1)
    append(ring, numbered(0, 10, 1))

    class Lapping:
        """The ring's memory, of which the writer replaces a part between the reader's look and its copy."""

        def __init__(self, counts: np.ndarray) -> None:
            self.counts, self.shape, self.lapped = counts, counts.shape, False

        def __getitem__(self, where: slice) -> np.ndarray:
            if not self.lapped:
                self.lapped = True
                append(ring, numbered(10, 4, 1))
            return self.counts[where]

    ring._counts = Lapping(ring._counts)  # type: ignore[assignment]
    with pytest.raises(Overwritten):
        ring.copy_into(2, np.empty((5, 1), np.int16))
    out = np.empty((5, 1), np.int16)
    ring.copy_into(6, out)
    np.testing.assert_array_equal(out, numbered(6, 5, 1))


def test_the_newest_samples_of_a_stream_are_its_own_and_where_they_begin_is_said() -> None:
    ring = Ring(10, 1)
    append(ring, numbered(0, 14, 1))
    stream = Stream(ring, 11, CaptureSettings(1e6, 500, 10), (), Setup(17.85e-3), "bench")
    for most, first in ((9, 11), (2, 12)):
        counts, begin = stream.newest(most)
        np.testing.assert_array_equal(counts, numbered(first, 14 - first, 1))
        assert begin == first
    stream.start = 5  # of which the writer replaces some meanwhile
    ring.space(8)
    with pytest.raises(Overwritten):
        stream.newest(9)
