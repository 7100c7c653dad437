"""Follows docs/add-a-digitizer.md with the code on that page: the row is all that has to be registered."""

import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Role
from app.command_line.parser import command_parser, flat_parser
from app.session.rig import Rig
from instrument.capture.capture import acquire
from instrument.devices import sources
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.sources import Source, open_source, source_of, source_words
from instrument.files.recording_file import open_recording
from tests.pages import code_blocks


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, row = code_blocks("add-a-digitizer.md")
    module = types.ModuleType("instrument.devices.tone_generator")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    exec(compile(driver, "tone_generator.py", "exec"), module.__dict__)
    monkeypatch.setattr(sources, "SOURCES", (*sources.SOURCES, eval(row, {"Source": Source})))


@pytest.mark.usefixtures("registered")
def test_the_pages_driver_records_its_tones(tmp_path: Path) -> None:
    digitizer = open_source("tone?mass=0.02")
    assert digitizer.setup.moving_mass_kg == 0.02
    (path,) = acquire(digitizer, tmp_path, 1, CaptureSettings(10e6, 400_000, 60_000), 10.0)
    recording = open_recording(path)
    assert [channel.role for channel in recording.channels] == [Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH]
    assert recording.trigger_sample == pytest.approx(60_000, abs=2)
    beat = np.asarray(recording.counts[:, 1], dtype=float)
    loudest = np.argmax(np.abs(np.fft.rfft(beat * np.hanning(beat.size)))) * 10e6 / beat.size
    assert loudest == pytest.approx(2.73e6, abs=25.0)


@pytest.mark.usefixtures("registered")
def test_the_row_is_listed_helped_and_bounded() -> None:
    assert source_of("tone?mass=1").name == "tone" and source_words().endswith(" or tone")
    with pytest.raises(DigitizerError, match="'colour=red' is no option: known are mass, rest, wavelength"):
        open_source("tone?colour=red")
    with pytest.raises(DigitizerError, match="takes no address"):
        open_source("tone:3")
    with pytest.raises(DigitizerError, match=r"use one of bench, .*, tone"):
        open_source("tune")
    rig = Rig.__new__(Rig)
    rig._network, rig._found = (), ()
    assert ("tone", "Tone generator") in rig.sources() and rig.sources()[-1][0] == "replay:"


def test_every_source_of_the_help_is_a_row() -> None:
    rows = [f"{source.name}:{source.address}" if source.address else source.name for source in sources.SOURCES]
    assert re.split(", | or ", source_words()) == rows
    for parser in (flat_parser(), command_parser("acquire"), command_parser("doctor")):
        assert source_words() in " ".join(parser.format_help().split())
    for source in sources.SOURCES:
        assert callable(sources.import_function(source.opener))
        assert not source.finder or callable(sources.import_function(source.finder))
