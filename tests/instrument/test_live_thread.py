"""The thread behind LIVE: a picture that fails is said and does not end it."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Channel, Role, Setup
from analysis.signal import LiveChunk
from instrument.devices.digitizer import CaptureSettings
from instrument.live import live_thread
from instrument.live.live_thread import LiveThread
from instrument.live.ring import Ring, Stream
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
        assert live.close()


def test_a_stream_without_a_moving_beat_says_so_and_still_shows_its_signals(tmp_path: Path) -> None:
    stream = _stream((Channel(Role.SWITCH, 1e-3),))
    live = LiveThread(lambda: stream, lambda: tmp_path)
    live.start()
    try:
        _until(lambda: live.view.problem is not None and live.channels != ())
        assert live.view.problem == "no measurement channel (PD1)"
        assert live.view.raw_v.shape[1] == 1 and live.view.raw_v.shape[0] > 100
    finally:
        assert live.close()


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
        assert live.close()


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
        assert live.close()


def test_samples_replaced_while_they_are_demodulated_are_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The writer laps the reader within one chunk: what came of it is dropped, counted as skipped, and time goes on."""
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
    assert at == stream.ring.total == 330_000 and live.skipped > lapped[0] > 0
    assert live._demodulator._sample == at
    shown_s, frequency_hz = live._window.curves()[:2]
    assert shown_s[0] > live.skipped / RATE_HZ and shown_s[-1] < at / RATE_HZ
    assert np.nanmax(np.abs(frequency_hz - 91e3)) < 50.0


def test_the_site_is_measured_on_the_rate_at_which_points_come(tmp_path: Path) -> None:
    stream = _stream()
    live = LiveThread(lambda: stream, lambda: tmp_path)
    live._begin(stream)
    live._follow(stream)
    rate_hz = live._demodulator.rate_hz if live._demodulator is not None else None
    assert live._rest is not None and rate_hz is not None
    assert live._rest._rate_hz == rate_hz / live_thread._AVERAGED
    time_s = live._window._values[0, : live._window._end]
    assert rate_hz == pytest.approx((time_s.size - 1) / (time_s[-1] - time_s[0]), rel=1e-9)
