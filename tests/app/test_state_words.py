"""What the banner and the signal line say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Role
from analysis.shot.shot import AnalysisSettings
from app.session.session import Entry
from app.window.controls.theme import Tone
from app.window.panels import state_words
from instrument.capture.acquisition import State
from instrument.capture.snapshot import CapturedShot, SignalLine, Snapshot
from instrument.devices.digitizer import CaptureSettings
from instrument.live.live_view import ChannelSignal, empty_view
from tests.app import synthetic

SETTINGS = CaptureSettings(1e6, 64, 0)


def _snapshot(state: State, **more) -> Snapshot:
    return replace(Snapshot(state, 0.0, False, "", "", SignalLine(), empty_view()), **more)


def test_every_state_has_a_word_a_sentence_and_a_tone():
    seen = {state: state_words.banner(_snapshot(state), None) for state in State}
    assert {word for word, _, _ in seen.values()} == {"READY", "ARMING", "ARMED", "CAPTURED", "ANALYSING", "FAULT"}
    assert all(sentence for _, sentence, _ in seen.values())
    assert seen[State.FAULT][2] is Tone.BAD


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"shots": 0}, "No shot was lost"),
        ({"shots": 1}, "The one shot taken so far is saved"),
        ({"shots": 3}, "All 3 shots so far are saved"),
        ({"shots": 3, "unsaved": ("shot-0003",)}, "In memory only: shot-0003"),
    ],
)
def test_a_fault_says_what_happened_what_was_saved_and_what_to_do(more, said):
    _, sentence, _ = state_words.banner(
        _snapshot(State.FAULT, message="the disk is full", remedy="free it", **more), None
    )
    assert sentence.startswith("The disk is full.")
    assert said in sentence
    assert sentence.endswith("Free it.")


@pytest.mark.parametrize(
    ("unsaved", "said"),
    [(("shot-0003",), "Save it elsewhere."), ((), "Arm again, or choose another")],
)
def test_a_shot_that_could_not_be_saved_is_to_be_saved_until_it_is(unsaved, said):
    told = {"message": "the disk is full", "remedy": "save it elsewhere", "save_failed": True}
    fault = _snapshot(State.FAULT, **told, shots=3, unsaved=unsaved)
    _, sentence, _ = state_words.banner(fault, None)
    assert said in sentence and ("Save it" in sentence) == bool(unsaved)


def _channel(role: Role, snr_db: float | None = 40.0, frequency_hz: float | None = 2.73e6, clipped: float = 0.0):
    return ChannelSignal(role, 0.5, 1.0, clipped, frequency_hz, snr_db)


def test_the_signal_line_judges_each_beat():
    def tone(channel):
        return state_words.tile_texts(SignalLine((_channel(Role.REFERENCE), channel)), 1e7, 1e4)["pd1"].tone

    assert tone(_channel(Role.MEASUREMENT)) is Tone.GOOD
    assert tone(_channel(Role.MEASUREMENT, 5.0)) is Tone.WARNING
    assert tone(_channel(Role.MEASUREMENT, None, None)) is Tone.BAD
    assert tone(_channel(Role.MEASUREMENT, 5.0, 3.5e6)) is Tone.NEUTRAL
    assert tone(_channel(Role.MEASUREMENT, 40.0, 3.5e6, 0.2)) is Tone.BAD


@pytest.mark.parametrize(("frequency_hz", "shown"), [(2.73e6, "µm/s at 10 kHz"), (3.5e6, "–")])
def test_no_noise_floor_is_told_while_the_block_moves(frequency_hz, shown):
    """A beat that sweeps has its own spectrum beside its line: that passed for 56 µm/s of noise."""
    line = SignalLine((_channel(Role.REFERENCE), _channel(Role.MEASUREMENT, 12.0, frequency_hz)))
    assert shown in state_words.tile_texts(line, 1e7, 1e4)["floor"].words


def test_a_shot_that_is_only_in_memory_is_not_called_saved():
    entry = Entry(2, "shot-0002", None, AnalysisSettings(), synthetic.bare_shot("shot-0002"))
    last = state_words.last_shot(entry)
    _, sentence, _ = state_words.banner(_snapshot(State.IDLE, unsaved=("shot-0002",)), last)
    assert "only in memory" in sentence and "Ctrl+S" in sentence and "is saved" not in sentence
    _, sentence, _ = state_words.banner(_snapshot(State.IDLE), last)
    assert "is saved" in sentence


@pytest.mark.parametrize(("count", "words"), [(0, ""), (1, "1 more shot waits for"), (12, "12 more shots wait for")])
def test_shots_that_wait_for_their_analysis_are_told(count, words):
    last = state_words.LastShot("shot-0013", "Shot 13 is saved.", "")
    _, sentence, _ = state_words.banner(
        _snapshot(State.IDLE, captured=(CapturedShot(1, "a", None, SETTINGS, waits=True),) * count), last
    )
    assert words in sentence and ("wait" in sentence) == (count > 0)


def test_a_disk_that_is_nearly_full_or_closed_to_us_is_bad():
    full = state_words.tile_texts(SignalLine(disk_free_bytes=10**8, folder=Path("/x")), None, 1e4)["disk"]
    closed = state_words.tile_texts(SignalLine(disk_free_bytes=10**12, folder_problem="no permission"), None, 1e4)[
        "disk"
    ]
    roomy = state_words.tile_texts(SignalLine(disk_free_bytes=3 * 10**9, folder=Path("/x")), None, 1e4)["disk"]
    assert full.tone is closed.tone is Tone.BAD and roomy.tone is Tone.GOOD
    assert closed.hover == "no permission"


def test_the_velocity_floor_is_what_white_phase_noise_gives():
    rate, bandwidth, snr_db = 1e6, 1e4, 30.0
    line = SignalLine((_channel(Role.MEASUREMENT, snr_db),))
    said = state_words.velocity_floor_m_per_s(line, rate, bandwidth)
    random = np.random.default_rng(3)
    phase = random.standard_normal(2**18) / np.sqrt(10 ** (snr_db / 10))
    spectrum = np.fft.rfft(phase)
    frequency = np.fft.rfftfreq(len(phase), 1 / rate)
    spectrum *= 2j * np.pi * frequency * 632.8e-9 / (4 * np.pi)
    spectrum[frequency > bandwidth] = 0
    assert np.fft.irfft(spectrum).std() == pytest.approx(said, rel=0.05)


def _signs(*channels, **line):
    return state_words.tile_texts(SignalLine(channels, **line), 1e7, 1e4)


@pytest.mark.parametrize(
    ("channel", "tone"),
    [
        (_channel(Role.REFERENCE, 15.0), Tone.GOOD),
        (_channel(Role.REFERENCE, 14.9), Tone.WARNING),
        (_channel(Role.REFERENCE, 40.0, clipped=1e-2), Tone.WARNING),
        (_channel(Role.REFERENCE, 40.0, clipped=1.1e-2), Tone.BAD),
        (_channel(Role.REFERENCE, None), Tone.BAD),
        (_channel(Role.REFERENCE, 40.0, None), Tone.BAD),
    ],
)
def test_a_beat_is_judged_by_its_strength_and_its_clipping(channel, tone):
    found = _signs(channel)
    assert found["pd0"].tone is tone and found["pd1"].words == "–"
    assert found["pd0"].words == ("no beat" if None in (channel.snr_db, channel.frequency_hz) else
        f"2.73000 MHz  {channel.snr_db:.0f} dB")  # fmt: skip


@pytest.mark.parametrize(("off_hz", "moves"), [(19.9e3, False), (-19.9e3, False), (20.1e3, True), (-20.1e3, True)])
def test_a_beat_20_khz_from_rest_moves(off_hz, moves):
    found = _signs(_channel(Role.REFERENCE), _channel(Role.MEASUREMENT, 40.0, 2.73e6 + off_hz))
    assert ("moving" in found["pd1"].words) == moves == (found["floor"].words == "–")


@pytest.mark.parametrize(
    ("free", "tone", "words"),
    [
        (2.1e9, Tone.GOOD, "2 GB free"),
        (1.9e9, Tone.BAD, "2 GB free"),
        (None, Tone.NEUTRAL, "–"),
    ],
)
def test_the_disk_is_nearly_full_below_2_gb(free, tone, words):
    found = _signs(disk_free_bytes=free)["disk"]
    assert (found.tone, found.words) == (tone, words)
    failed = _signs(disk_free_bytes=free, folder_problem="no such folder")["disk"]
    assert (failed.tone, failed.words, failed.hover) == (Tone.BAD, "cannot save", "no such folder")


@pytest.mark.parametrize("bandwidth_hz", [1e4, 3e4])
def test_the_noise_floor_is_that_of_white_phase_noise_differentiated(bandwidth_hz):
    """Of random phases: SNR 40 dB and 30 dB at 10 MS/s, differentiated in the spectrum up to the bandwidth."""
    line = SignalLine((_channel(Role.REFERENCE, 40.0), _channel(Role.MEASUREMENT, 30.0), _channel(Role.SWITCH, None)))
    found = state_words.velocity_floor_m_per_s(line, 1e7, bandwidth_hz)
    rng, rate, n = np.random.default_rng(2), 1e7, 1 << 20
    phase = rng.normal(0, np.sqrt(10**-4.0), n) + rng.normal(0, np.sqrt(10**-3.0), n)  # variance 1 / SNR a beat
    frequency = np.fft.rfftfreq(n, 1 / rate)
    turned = np.fft.irfft(np.where(frequency <= bandwidth_hz, 2j * np.pi * frequency, 0) * np.fft.rfft(phase), n)
    assert found == pytest.approx(632.8e-9 / (4 * np.pi) * turned.std(), rel=0.05)
    assert state_words.velocity_floor_m_per_s(SignalLine((_channel(Role.SWITCH, None),)), 1e7, 1e4) is None
    assert state_words.velocity_floor_m_per_s(SignalLine((_channel(Role.REFERENCE, None),)), 1e7, 1e4) is None


def test_how_many_shots_wait_is_told_except_the_one_under_way():
    waiting = tuple(CapturedShot(n, f"s{n}", None, SETTINGS, waits=True) for n in range(3))
    for state, count, words in (
        (State.IDLE, 1, " 1 more shot waits for analysis."),
        (State.ARMED, 2, " 2 more shots wait for analysis."),
        (State.ANALYSING, 2, " 1 more shot waits for analysis."),
        (State.ANALYSING, 1, "now."),
        (State.TRIGGERED, 3, "shot."),
    ):
        _, sentence, _ = state_words.banner(_snapshot(state, captured=waiting[:count]), None)
        assert sentence.endswith(words)
    assert "Re-arms automatically" in state_words.banner(_snapshot(State.ARMED, automatic=True), None)[1]
    assert "Re-arms automatically" not in state_words.banner(_snapshot(State.ARMED), None)[1]
    assert state_words.banner(_snapshot(State.ARMING), None)[0] == "ARMING"
