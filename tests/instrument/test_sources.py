"""The text of --source: the digitizer that it opens, and the one line for an error."""

import re
import sys
from types import SimpleNamespace

import pytest

from instrument.devices import usb_bus
from instrument.devices.digitizer import DigitizerError
from instrument.devices.source_options import SourceOptions
from instrument.devices.sources import (
    SOURCES,
    import_function,
    is_bench,
    listed_sources,
    open_source,
    source_of,
    source_words,
    with_push,
    with_site,
)
from tests.instrument.devices.scripted_usb import In, Plugged, ScriptedUsb


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "unknown source ''"),
        ("oscilloscope", "unknown source 'oscilloscope': use one of bench, replay:PATH, hantek6022"),
        ("scpi", "unknown source"),
        ("replay:", "unknown source"),
        ("replay:/no/such/folder", "nothing to replay at /no/such/folder"),
        ("bench?colour=3", "is no option"),
        ("bench?speed=3", "a push to 3.0 m/s: 0.02 to 1 m/s can be simulated"),
        ("bench?added=2", "weights of 2.0 kg on the block: 0 to 1 kg can be simulated"),
        ("bench?speed=fast", "'fast' is no speed"),
        ("bench?effect=gremlins", "no effect is called"),
        ("bench?site=cellar", "no site is called 'cellar'; there are quiet, ISO-office, VC-A"),
        ("hantek6022:3", "takes no address"),
        ("hantek6022?gains=3,3", "input gain must be one of 1, 2, 5, 10"),
        ("hantek6022?gains=x", "'x' is no gain number"),
        ("hantek6022?roles=switch,reference", "must carry the measuring beat"),
        ("hantek6022?roles=pd0,pd1", "names an unknown role: known are reference, measurement, switch"),
        ("hantek6022?colour=red", "'colour=red' is no option: known are roles, gains, firmware, mass"),
        ("scpi:not an address", "is no address of an oscilloscope"),
        ("scpi:host:99999", "is no address of an oscilloscope"),
        ("scpi:host?channels=1,1", "must name each channel once"),
        ("scpi:host?slope=up", "neither rising nor falling"),
        ("scpi:host?level=1e999999", "is no level"),
        ("hantek6022?mass=0", "mass=0 is not above zero"),
        ("scpi:host?wavelength=-632e-9", "wavelength=-632e-9 is not above zero"),
        ("niscope:Dev1?trigger=2&range=wide", "is no range"),
    ],
)
def test_a_wrong_source_is_one_clear_line(text: str, line: str) -> None:
    with pytest.raises(DigitizerError, match=re.escape(line)) as caught:
        open_source(text)
    assert "\n" not in str(caught.value)


def test_a_bench_stands_where_it_is_put() -> None:
    assert with_site("bench", "VC-D") == "bench?site=VC-D"
    assert with_site("bench?effect=tilt", "my site&.toml") == "bench?effect=tilt&site=my%20site%26.toml"
    assert with_site("bench?site=VC-A", "VC-D") == "bench?site=VC-A"
    assert with_site("scpi:host?channels=1", "VC-D") == "scpi:host?channels=1"


def test_a_push_of_the_bench_is_set_and_nothing_else() -> None:
    once = with_push("bench?effect=tilt&seed=4", 0.35, 0.05, 3)
    assert once == "bench?effect=tilt&seed=4&speed=0.3500&added=0.05000&first=3"
    assert with_push(once, 0.1, 0.0, 4) == "bench?effect=tilt&seed=4&speed=0.1000&added=0.00000&first=4"
    assert open_source(once).setup.moving_mass_kg == pytest.approx(17.85e-3 + 0.05)


def test_roles_gains_and_firmware_reach_the_hantek(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [In(0xA2, 8, 80, b"")])
    monkeypatch.setattr(usb_bus, "find_backend", lambda: bus)
    digitizer = open_source("hantek6022?roles=switch,measurement&gains=1,10&firmware=/a:b")
    switch, beat = digitizer.capabilities.channels
    assert (switch.role, beat.role) == ("switch", "measurement")
    assert switch.volts_per_count == pytest.approx(10 * beat.volts_per_count)
    digitizer.close()
    bus.finish()


def test_the_rig_is_assumed_until_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    setups = []
    for text in ("hantek6022", "hantek6022?roles=switch,measurement&mass=0.0213&rest=2.73e6&wavelength=632.8e-9"):
        bus = ScriptedUsb([Plugged(0x04B5, 0x6022)], [In(0xA2, 8, 80, b"")])
        monkeypatch.setattr(usb_bus, "find_backend", lambda bus=bus: bus)
        setups.append(open_source(text).setup)
    assert (setups[0].moving_mass_kg, dict(setups[0].extra)) == (17.85e-3, {"moving_mass_assumed": True})
    assert (setups[1].moving_mass_kg, setups[1].rest_frequency_hz) == (0.0213, 2.73e6)
    assert (setups[1].wavelength_air_m, dict(setups[1].extra)) == (632.8e-9, {})
    monkeypatch.setitem(sys.modules, "niscope", SimpleNamespace(Session=lambda name: None))
    of_card = open_source("niscope:Dev1?rest=2e6").setup
    assert (of_card.rest_frequency_hz, of_card.moving_mass_kg) == (2e6, 17.85e-3)
    assert dict(of_card.extra) == {"moving_mass_assumed": True} == dict(open_source("niscope:Dev1").setup.extra)


def test_what_is_told_of_the_sources() -> None:
    assert source_words().startswith("bench, replay:PATH, hantek6022, scpi:ADDRESS")
    assert [(text, name) for text, name in listed_sources() if source_of(text).name in ("bench", "replay")] == [
        ("bench", "Simulated bench"),
        ("bench?effect=quadratic_drag:coefficient_n_s2_per_m2=3e-3", "Simulated bench with a flaw"),
        ("replay:", "Play a recording …"),
    ]
    told = {
        source.name: (source.simulated, source.states_setup, source.in_subprocess, source.remembered, source.finder)
        for source in SOURCES
    }
    kept = {
        "bench": (True, True, True, True, ""),
        "replay": (False, True, False, False, ""),
        "hantek6022": (False, False, True, True, "devices.device_search:hantek6022"),
        "scpi": (False, False, True, True, "devices.device_search:oscilloscopes"),
        "niscope": (False, False, True, True, "devices.device_search:ni_cards"),
    }
    assert told.items() >= kept.items()
    for text, name in ((" Bench?seed=3", "bench"), ("SCPI:usb", "scpi"), ("replay", "replay"), ("benches", "")):
        assert source_of(text).name == name
    assert is_bench("bench") and is_bench(" BENCH?seed=1") and not is_bench("benches") and not is_bench("replay:bench")


def test_every_source_can_be_opened_and_a_package_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for source in SOURCES:
        assert callable(import_function(source.opener)) and (
            not source.finder or callable(import_function(source.finder))
        )
    monkeypatch.setitem(sys.modules, "instrument.bench", None)
    with pytest.raises(DigitizerError, match=r"this source needs instrument\.bench, which is not installed"):
        open_source("bench")


def test_options_are_read_as_an_address_writes_them() -> None:
    read = SourceOptions.read("a=x%20y%26&&b=1=2&a=z", "scpi", ("a", "b"))
    assert read.given == {"a": "z", "b": "1=2"} and "a" in read and "c" not in read
    assert read.text("b", "usual") == "1=2" and read.text("c", "usual") == "usual"
    assert SourceOptions.read("a=x%20y%26", "scpi", ("a",)).text("a", "") == "x y&"
    for wrong in ("c=1", "a", "a=", "=1", "a=1&" + "x" * 80 + "=1"):
        with pytest.raises(DigitizerError, match=r"source scpi: '.{0,56}('|\.\.\.) is no option: known are a, b"):
            SourceOptions.read(wrong, "scpi", ("a", "b"))
