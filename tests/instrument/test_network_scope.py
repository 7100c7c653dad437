"""Addresses of oscilloscopes: which are accepted and refused, before anything is connected."""

import pytest

from instrument.devices.digitizer import DigitizerError
from instrument.devices.scpi_address import network_name, network_source


@pytest.mark.parametrize(
    ("typed", "source"),
    [
        (" 192.168.1.5 ", "scpi:192.168.1.5"),
        ("scope.lab:5025", "scpi:scope.lab:5025"),
        ("[fe80::1]:5555", "scpi:[fe80::1]:5555"),
        ("SCPI:scope?channels=1,2&trigger=3", "scpi:scope?channels=1,2&trigger=3"),
        ("TCPIP0::192.168.1.5::INSTR", "scpi:TCPIP0::192.168.1.5::INSTR"),
    ],
)
def test_an_address_is_a_source(typed: str, source: str) -> None:
    assert network_source(typed) == source
    assert network_source(source) == source
    assert "?" not in network_name(source)


@pytest.mark.parametrize(
    "typed", ["", "  ", "two words", "host:", "host:0", "host:70000", "a/b", "-x", "host?", "host?x", "usb", "x" * 400]
)
def test_what_is_none_is_refused_in_one_line(typed: str) -> None:
    with pytest.raises(DigitizerError) as refusal:
        network_source(typed)
    assert refusal.value.remedy and "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 250
