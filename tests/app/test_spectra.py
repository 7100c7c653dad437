"""SPECTRUM: the beats stand at their frequencies and times, with their levels, and go when there is no recording."""

import numpy as np
import pytest
from PySide6.QtCore import QPointF
from PySide6.QtWidgets import QLabel

from analysis.shot.recording import Channel, Recording, Role, Setup
from analysis.shot.shot import Cancelled
from app.session.spectra import BINS, spectra_of
from app.window.panels.spectrum import SpectrumPanel
from instrument.live.setup_check import CHANNEL_NAMES

RATE_HZ, ROWS, ZERO_S = 1e6, 64, 0.1
CHANNELS = (Channel(Role.MEASUREMENT, 1e-4), Channel(Role.REFERENCE, 1e-4))
PD0_HZ, BEFORE_HZ, AFTER_HZ = 205e3, 225e3, 185e3


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Return PD0 of 0.4 V, and PD1 of 0.2 V whose frequency falls in the middle of the record, both on an offset."""
    at, noise = np.arange(ROWS * BINS), np.random.default_rng(1)
    moving = np.where(at < at.size // 2, BEFORE_HZ, AFTER_HZ)
    volts = np.column_stack(
        [0.2 * np.sin(2 * np.pi * moving * at / RATE_HZ), 0.4 * np.sin(2 * np.pi * PD0_HZ * at / RATE_HZ)]
    )
    volts += 0.5 + noise.normal(0.0, 1e-3, volts.shape)
    return Recording("shot-1", np.rint(volts * 1e4).astype(np.int16), RATE_HZ, CHANNELS, Setup(17.85e-3))


@pytest.fixture(scope="module")
def spectra(recording):
    return spectra_of(recording, ZERO_S, lambda words, share: None, lambda: False)


def test_each_beat_stands_at_its_frequency_as_far_above_the_noise_as_it_is(spectra):
    still, moving = spectra.power_db[Role.REFERENCE], spectra.power_db[Role.MEASUREMENT]
    bin_hz = spectra.frequency_hz[1]
    assert bin_hz == pytest.approx(RATE_HZ / BINS)
    assert spectra.frequency_hz[still.argmax()] == pytest.approx(PD0_HZ, abs=bin_hz)
    tops = [
        spectra.frequency_hz[np.argmax(np.where(abs(spectra.frequency_hz - f) < 5e3, moving, -999))]
        for f in (BEFORE_HZ, AFTER_HZ)
    ]
    assert tops == pytest.approx([BEFORE_HZ, AFTER_HZ], abs=bin_hz)
    # half the amplitude, and each frequency for half of the time: 9 dB; bins that lie beside a line lose up to 1.4 dB
    assert still.max() - moving.max() == pytest.approx(9.0, abs=1.5)
    # a line of amplitude A in noise of std s, under a Hann window of n samples: A^2 n / (6 s^2)
    above = 10 * np.log10(0.4**2 * BINS / (6 * 1e-3**2))
    assert still.max() - np.mean(still[-500:]) == pytest.approx(above, abs=1.6)
    assert still[0] < still.max() - 60  # the offset is none of the spectrum
    low, high = spectra.power_span_db
    assert low < np.median(still) and high > still.max() and high - low < 110


def test_the_density_is_one_sided_as_its_axis_is(spectra):
    """White noise of std s has 2 s^2 / rate between 0 and half the rate; it was shown 3 dB lower."""
    noise_v2 = 1e-3**2 + 1e-4**2 / 12  # of the samples, and of rounding to counts of 0.1 mV
    expected_db = 10 * np.log10(2 * noise_v2 / RATE_HZ)
    for power_db in spectra.power_db.values():
        assert 10 * np.log10(np.mean(10 ** (power_db[-500:-1] / 10))) == pytest.approx(expected_db, abs=0.1)


def test_the_picture_has_the_moving_beats_frequency_at_every_time(spectra):
    low, high = spectra.image_span_hz
    rows, bins = spectra.image_db.shape
    assert rows == ROWS and low <= AFTER_HZ < BEFORE_HZ <= high
    found = low + (high - low) * spectra.image_db.argmax(axis=1) / (bins - 1)
    assert found[: ROWS // 2] == pytest.approx(BEFORE_HZ, abs=300) and found[ROWS // 2 :] == pytest.approx(
        AFTER_HZ, abs=300
    )
    assert spectra.image_span_s == pytest.approx((-ZERO_S, ROWS * BINS / RATE_HZ - ZERO_S))
    assert spectra.image_levels_db[1] == spectra.image_db.max() > spectra.image_levels_db[0]


def test_spectra_of_less_are_less_and_they_end_when_told(recording):
    alone = Recording("b", recording.counts[: 5 * BINS, :1].copy(), RATE_HZ, CHANNELS[:1], Setup(17.85e-3))
    found = spectra_of(alone, 0.0, lambda words, share: None, lambda: False)
    assert list(found.power_db) == [Role.MEASUREMENT] and found.image_db.shape[0] == 5
    assert found.image_span_s == pytest.approx((0.0, 5 * BINS / RATE_HZ))
    longer = Recording("d", recording.counts[: 6 * BINS - 1].copy(), RATE_HZ, CHANNELS, Setup(17.85e-3))
    found = spectra_of(longer, 0.0, lambda words, share: None, lambda: False)
    assert found.image_db.shape[0] == 5  # the rest of the record is in no row, and the picture ends before it
    assert found.image_span_s == pytest.approx((0.0, 5 * BINS / RATE_HZ))
    short = Recording("c", recording.counts[: BINS - 1].copy(), RATE_HZ, CHANNELS, Setup(17.85e-3))
    found = spectra_of(short, 0.0, lambda words, share: None, lambda: False)
    assert found.power_db == {} and found.image_db.size == 0
    said = []
    spectra_of(recording, 0.0, lambda words, share: said.append((words, share)), lambda: False)
    assert {words.split(" of ")[0] for words, _ in said} == {"spectrum"} and all(
        0.0 <= share < 1.0 for _, share in said
    )
    with pytest.raises(Cancelled):
        spectra_of(recording, 0.0, lambda words, share: None, lambda: True)


def test_the_page_shows_both_and_clears_them(qtbot, spectra):
    panel = SpectrumPanel()
    qtbot.addWidget(panel)
    panel.resize(900, 700)
    panel.show()
    assert panel.picture.image is None and any("Select a shot" in label.text() for label in panel.findChildren(QLabel))
    panel.show_spectra(spectra, None, "shot-1")
    assert panel.picture.image is not None and not any(
        "Select a shot" in label.text() for label in panel.findChildren(QLabel)
    )
    spectrum, image = panel.plots
    place = panel.picture.mapRectToParent(panel.picture.boundingRect())
    low, high = spectra.image_span_hz
    assert (place.left(), place.right()) == pytest.approx((-1e3 * ZERO_S, 1e3 * spectra.image_span_s[1]))
    assert (place.top(), place.bottom()) == pytest.approx((1e-6 * low, 1e-6 * high))
    for row, beat_hz in ((5, BEFORE_HZ), (ROWS - 5, AFTER_HZ)):
        drawn = panel.picture.mapToParent(QPointF(row + 0.5, spectra.image_db[row].argmax() + 0.5))
        assert drawn.x() == pytest.approx(1e3 * ((row + 0.5) * BINS / RATE_HZ - ZERO_S))
        assert drawn.y() == pytest.approx(1e-6 * beat_hz, abs=1e-3)
    (left, right), (bottom, top) = image.plot.view.viewRange()
    assert (left, right) == pytest.approx((-1e3 * ZERO_S, 1e3 * spectra.image_span_s[1]))
    assert (bottom, top) == pytest.approx((1e-6 * low, 1e-6 * high))
    assert np.ptp(spectrum.plot.view.viewRange()[0]) == pytest.approx(1e-6 * (high - low))
    frequency, *powers = spectrum.columns.items()
    assert frequency[0] == "frequency (MHz)" and frequency[1][-1] == pytest.approx(0.5e-6 * RATE_HZ)
    assert [name for name, _ in powers] == [f"{CHANNEL_NAMES[role]} (dB above 1 V²/Hz)" for role in spectra.power_db]
    panel.show_spectra(None)
    assert panel.picture.image is None and any("Select a shot" in label.text() for label in panel.findChildren(QLabel))
