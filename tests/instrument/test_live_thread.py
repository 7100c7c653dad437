"""The thread behind LIVE: a picture that fails is said and does not end it."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.shot.recording import Channel, Role, Setup
from analysis.signal import LiveChunk
from instrument.devices.digitizer import CaptureSettings
from instrument.devices.ring import Ring
from instrument.live import live_thread
from instrument.live.live_thread import LiveThread
from instrument.live.stream import Stream
from tests.instrument.capturing import append

RATE_HZ = 1e6
CHANNELS = (Channel(Role.MEASUREMENT, 1e-3),)


def _stream(channels: tuple[Channel, ...] = CHANNELS) -> Stream:
    """Return a stream of a beat of 91 kHz."""
    ring = Ring(200_000, 1)
    beat = np.rint(900 * np.sin(2 * np.pi * 0.091 * np.arange(150_000)))
    append(ring, beat.astype(np.int16)[:, None])
    settings = CaptureSettings(RATE_HZ, 50_000, 1000)
    return Stream(ring, 0, settings, channels, Setup(17.85e-3, rest_frequency_hz=91e3), "bench")


def _until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_a_picture_that_fails_is_said_and_the_next_stream_is_shown(tmp_path: Path) -> None:
    stream: list[Stream | None] = [None]

    def newest() -> Stream | None:
        if stream[0] is None:
            raise ZeroDivisionError("no rate\nat all")
        return stream[0]

    live = LiveThread(newest, lambda: tmp_path)
    assert live.view.problem is None
    live.start()
    try:
        _until(lambda: live.view.problem is not None)
        view = live.view
        assert view.problem == "the live picture failed: ZeroDivisionError('no rate\\nat all')"
        assert view.raw_time_s.shape == (0,) and view.raw_v.shape == (0, 0) and view.time_s.size == 0
        stream[0] = _stream()
        _until(lambda: live.view.time_s.size > 0 and live.channels != ())
        assert live.view.problem is None
        assert live.view.raw_v.shape == (live.view.raw_time_s.size, 1) and live.view.raw_time_s.size > 100
        assert live.channels[0].frequency_hz == pytest.approx(91e3, rel=1e-2)
        assert live.disk_free_bytes is not None and live.disk_free_bytes > 0
    finally:
        assert live.close(10.0)


def test_a_stream_without_a_moving_beat_says_so_and_still_shows_its_signals(tmp_path: Path) -> None:
    stream = _stream((Channel(Role.SWITCH, 1e-3),))
    live = LiveThread(lambda: stream, lambda: tmp_path)
    live.start()
    try:
        _until(lambda: live.view.problem is not None and live.channels != ())
        assert live.view.problem == "no measurement channel (PD1)"
        assert live.view.raw_v.shape[1] == 1 and live.view.raw_v.shape[0] > 100
    finally:
        assert live.close(10.0)


def test_a_stream_that_nobody_watches_shows_a_new_fault_soon(tmp_path: Path) -> None:
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    live.watched = False
    live.start()
    try:
        _until(lambda: live.channels != ())
        assert live.channels[0].clipped_fraction == 0.0
        append(stream.ring, np.full((9000, 1), (1 << stream.setup.digitizer_bits - 1) - 1, np.int16))
        _until(lambda: live.channels[0].clipped_fraction > 0.0, 2.0)  # on a busy machine
        assert live_thread._SIGNALS_EVERY_S <= 0.2  # with the pull of a still page a third of a second
        assert live.view.time_s.size == 0  # and nothing is demodulated
    finally:
        assert live.close(10.0)


def test_signals_are_looked_at_in_every_second_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    asked: list[float] = []
    checked = live_thread.check_signals
    monkeypatch.setattr(live_thread, "check_signals", lambda *of: asked.append(now) or checked(*of))
    for now in np.arange(10.0, 12.0, 0.1):
        live._look(float(now))
    assert len(asked) == 10 and asked[0] == 10.0


def test_looks_come_at_their_pace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten pictures a second where somebody watches, five checks where nobody does; neither more often."""
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    looks: list[float] = []
    monkeypatch.setattr(live, "_look", looks.append)
    live.start()
    try:
        for watched, least_s in ((True, 0.09), (False, 0.19)):
            live.watched = watched
            _until(lambda: len(looks) > 2)
            looks.clear()
            _until(lambda: len(looks) > 4)
            assert (looks[4] - looks[1]) / 3 > least_s
    finally:
        assert live.close(10.0)


def test_samples_replaced_while_others_are_demodulated_are_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The writer laps the reader within one chunk: what came of it is shown, what is gone is counted as skipped."""
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    live._begin(stream)
    assert live._demodulator is not None
    feed, lapped = live._demodulator.feed, []

    def lapping(counts: np.ndarray) -> LiveChunk:
        if not lapped:
            lapped.append(counts.shape[0])
            more = np.rint(900 * np.sin(2 * np.pi * 0.091 * np.arange(150_000, 330_000)))
            append(stream.ring, more.astype(np.int16)[:, None])
        return feed(counts)

    monkeypatch.setattr(live._demodulator, "feed", lapping)
    live._follow(stream)
    at = live._at
    assert at == stream.ring.total == 330_000 and live.skipped == 330_000 - live._most - lapped[0] > 0
    assert live._demodulator._sample == at
    shown_s, frequency_hz = live._window.curves()[:2]
    assert 0.1 < shown_s[0] < 0.11 and shown_s[-1] < at / RATE_HZ
    assert np.nanmax(np.abs(frequency_hz - 91e3)) < 50.0


def test_the_site_is_measured_on_the_rate_at_which_points_come(tmp_path: Path) -> None:
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    live._begin(stream)
    live._follow(stream)
    rate_hz = live._demodulator.rate_hz if live._demodulator is not None else None
    assert live._rest is not None and rate_hz is not None
    assert live._rest._rate_hz == rate_hz / live_thread._AVERAGED
    time_s = live._window._values[0]
    assert rate_hz == pytest.approx((time_s.size - 1) / (time_s[-1] - time_s[0]), rel=1e-9)


def test_a_new_stream_begins_with_empty_curves_and_is_demodulated_in_quarters_of_its_ring_up_to_half_a_million(
    tmp_path: Path,
) -> None:
    first, second = _stream(), replace(_stream(), ring=Ring(3_000_000, 1))
    live = LiveThread(lambda: first, lambda: tmp_path)
    live._look(10.0)
    live.skipped, live._rest, live._problem = 7, None, "dim"
    assert live._window.curves()[0].size > 0 and live._most == 50_000
    newest = np.arange(148_000, 150_000)
    assert live.view.raw_time_s == pytest.approx(newest / RATE_HZ)
    assert live.view.raw_v[:, 0] == pytest.approx(np.rint(900 * np.sin(2 * np.pi * 0.091 * newest)) * 1e-3)
    assert live.view.skipped == 100_000  # more than half of the ring waited
    asked: list[object] = []
    live._newest = lambda: second
    real = live._begin
    live._begin = lambda stream: (asked.append(stream), real(stream))[1]  # type: ignore[func-returns-value, method-assign]
    for now in (11.0, 12.0):
        live._look(now)
    assert asked == [second] and live._window.curves()[0].size == 0 and live._most == 1 << 19
    assert (live.skipped, live._problem, live._at) == (0, None, 0)


def test_a_picture_is_drawn_where_there_is_something_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    drawn: list[int] = []
    monkeypatch.setattr(live, "_draw", lambda stream: drawn.append(stream.ring.total))
    for more in (0, 0, 100, 0):
        append(stream.ring, np.zeros((more, 1), np.int16))
        live._look(10.0)
    assert drawn == [150_000, 150_100]


class Fed:
    """Stands for the demodulator: notes what it is fed, one number a sample, and "gap" with the samples lost."""

    rate_hz = None

    def __init__(self) -> None:
        self.came: list[int | tuple[str, int | None]] = []
        self.pieces: list[int] = []

    def feed(self, counts: np.ndarray) -> LiveChunk:
        self.came += counts[:, 0].tolist()
        self.pieces.append(len(counts))
        none = np.empty(0)
        return LiveChunk(none, none, none, none, None, "dim")

    def gap(self, lost: int | None) -> None:
        self.came.append(("gap", lost))


def _numbered(ring: Ring, first: int, length: int) -> None:
    append(ring, np.arange(first, first + length).astype(np.int16)[:, None])


def _ring_and_stream() -> tuple[Ring, Stream]:
    ring = Ring(4000, 1)
    settings, setup = CaptureSettings(RATE_HZ, 50, 10), Setup(17.85e-3, rest_frequency_hz=91e3)
    return ring, Stream(ring, 0, settings, CHANNELS, setup, "bench")


def _fed(stream: Stream, tmp_path: Path) -> tuple[LiveThread, Fed]:
    live, fed = LiveThread(lambda: stream, lambda: tmp_path), Fed()
    live._begin(stream)
    live._demodulator = fed  # type: ignore[assignment]
    return live, fed


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 900), st.sampled_from([0, 0, 5, None])), max_size=8), st.integers(0, 700))
def test_every_sample_is_demodulated_once_and_each_loss_at_its_place(
    tmp_path: Path, blocks: list[tuple[int, int | None]], start: int
) -> None:
    ring = Ring(3000, 1)
    _numbered(ring, 20_000, start)  # of the stream before
    stream = Stream(
        ring, start, CaptureSettings(RATE_HZ, 50, 10), CHANNELS, Setup(17.85e-3, rest_frequency_hz=91e3), "bench"
    )
    live, fed = _fed(stream, tmp_path)
    assert live._most == 750  # a quarter of the ring
    known: list[int | tuple[str, int | None]] = []
    number = 0
    for length, lost in blocks:
        if lost != 0 and length:
            if ring.total > start:
                known.append(("gap", lost))
            stream.note_loss(ring.total, lost)
        known += range(number, number + length)
        _numbered(ring, number, length)
        number += length
        assert live._follow(stream) == (length > 0)
        assert live._at == ring.total
    assert fed.came == known and live.skipped == 0 and max(fed.pieces, default=0) <= 750
    assert live._problem == ("dim" if number else None)


def test_what_lags_by_half_a_ring_goes_on_with_the_newest_quarter_and_counts_what_it_left_out(tmp_path: Path) -> None:
    ring, stream = _ring_and_stream()
    live, fed = _fed(stream, tmp_path)
    _numbered(ring, 0, 2000)
    live._follow(stream)
    assert fed.came == list(range(2000))
    stream.note_loss(ring.total, 3)  # among what is left out
    _numbered(ring, 2000, 2001)
    live._follow(stream)
    assert fed.came[2000:] == [("gap", 1001), *range(3001, 4001)] and live.skipped == 1001
    live.watched = False
    _numbered(ring, 4001, 900)
    live._look(1.0)
    assert live._at == 4001 and live.view.raw_v.size == 0
    live.watched = True
    live._look(1.1)  # looked at again: the newest 250
    assert live.skipped == 1001 + 650 and fed.came[3001:] == [("gap", 650), *range(4651, 4901)]
    assert live.view.skipped == 1651 and live.view.problem == "dim"
    _numbered(ring, 4901, 900)
    live._look(1.2)  # and from then on every sample
    assert live.skipped == 1651 and fed.came[-900:] == list(range(4901, 5801))
    live._begin(stream)
    assert (live.skipped, live._at, live._rest, live._problem) == (0, 0, None, None)


def test_a_reader_that_is_lapped_goes_on_with_the_newest_samples(tmp_path: Path) -> None:
    ring, stream = _ring_and_stream()
    live, fed = _fed(stream, tmp_path)
    _numbered(ring, 0, 1500)
    feed = fed.feed

    def lapped(counts: np.ndarray) -> LiveChunk:
        if len(fed.pieces) == 1:
            _numbered(ring, 1500, 3600)
        return feed(counts)

    fed.feed = lapped  # type: ignore[method-assign]
    live._follow(stream)
    assert fed.pieces == [1000, 500, 1000] and fed.came[1500:] == [("gap", 2600), *range(4100, 5100)]
    assert live.skipped == 2600 and live._at == 5100


def test_the_newest_two_thousand_samples_are_shown_in_volts_at_their_times_in_the_stream(tmp_path: Path) -> None:
    ring = Ring(10_000, 2)
    counts = np.random.default_rng(3).integers(-2000, 2000, (4000, 2)).astype(np.int16)
    append(ring, counts[:500])
    channels = (Channel(Role.MEASUREMENT, 1e-3, 0.5), Channel(Role.SWITCH, -2e-3, -1.0))
    stream = Stream(ring, 500, CaptureSettings(RATE_HZ, 50, 10), channels, Setup(1.0, rest_frequency_hz=91e3), "bench")
    live = LiveThread(lambda: stream, lambda: tmp_path)
    for came, shown in ((60, 0), (64, 64), (1500, 1500), (2600, 2000)):
        append(ring, counts[ring.total : 500 + came])
        live._signals_s = -np.inf
        live._look(10.0 + came)
        assert (len(live.channels) > 0) == (came >= 64)  # fewer tell nothing of a signal
        length = shown or came
        first = 500 + came - length
        assert live.view.raw_time_s == pytest.approx((first - 500 + np.arange(length)) / RATE_HZ, abs=1e-12)
        volts = counts[first : 500 + came] * np.array([1e-3, -2e-3]) + np.array([0.5, -1.0])
        assert live.view.raw_v == pytest.approx(volts, abs=1e-6)
    assert live.channels[1].amplitude_v == pytest.approx(np.median(counts[500:3100, 1]) * -2e-3 - 1.0)
    assert live.view.floor is None


def test_the_room_on_the_disk_is_asked_for_once_a_second(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Path] = []
    monkeypatch.setattr(live_thread, "disk_free_bytes", lambda folder: asked.append(folder) or 7)
    live = LiveThread(lambda: None, lambda: tmp_path)
    for now in np.arange(0.0, 3.05, 0.1):
        live._look(float(now))
    assert asked == [tmp_path] * 3 and live.disk_free_bytes == 7
