"""Addresses of oscilloscopes: which are accepted and refused, before anything is connected."""

import socket
from typing import NoReturn

import pytest

from analysis.shot.recording import Role
from instrument.devices import scpi, scpi_links
from instrument.devices.digitizer import DigitizerError
from instrument.devices.scpi import _link, network_name, network_source
from instrument.devices.source_options import SourceOptions


@pytest.mark.parametrize(
    ("typed", "source"),
    [
        (" 192.168.1.5 ", "scpi:192.168.1.5"),
        ("scope.lab:5025", "scpi:scope.lab:5025"),
        ("scope.lab:1", "scpi:scope.lab:1"),
        ("scope.lab:65535", "scpi:scope.lab:65535"),
        ("[fe80::1]:5555", "scpi:[fe80::1]:5555"),
        ("SCPI:scope?channels=1,2&trigger=3", "scpi:scope?channels=1,2&trigger=3"),
        ("TCPIP0::192.168.1.5::INSTR", "scpi:TCPIP0::192.168.1.5::INSTR"),
    ],
)
def test_an_address_is_a_source(typed: str, source: str) -> None:
    assert network_source(typed) == source
    assert network_source(source) == source
    assert network_name(source) == "Oscilloscope at " + source[5:].split("?")[0]


@pytest.mark.parametrize(
    "typed", ["", "  ", "two words", "host:", "host:0", "host:65536", "a/b", "-x", "host?", "host?x", "usb", "x" * 400]
)
def test_what_is_none_is_refused_in_one_line(typed: str) -> None:
    with pytest.raises(DigitizerError) as refusal:
        network_source(typed)
    assert refusal.value.remedy and "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 250


@pytest.mark.parametrize(
    ("address", "link", "given"),
    [
        ("192.168.1.5", "SocketTransport", ("192.168.1.5", None)),
        ("scope.lab:65535", "SocketTransport", ("scope.lab", 65535)),
        ("scope.lab:1", "SocketTransport", ("scope.lab", 1)),
        ("[fe80::1]:5555", "SocketTransport", ("fe80::1", 5555)),
        ("TCPIP0::1.2.3.4::INSTR", "VisaTransport", ("TCPIP0::1.2.3.4::INSTR",)),
    ],
)
def test_an_address_is_reached_over_its_kind_of_link(
    address: str, link: str, given: tuple[object, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(scpi, link, lambda *all_of_it: asked.append(all_of_it))
    _link(address)
    assert asked == [given]
    for wrong in ("host:65536", "host:0", "a b", ""):
        with pytest.raises(DigitizerError, match="is no address of an oscilloscope: give HOST"):
            _link(wrong)


def test_without_a_port_those_of_the_makers_are_tried_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[object, float]] = []

    def refuse(address: tuple[str, int], timeout: float) -> NoReturn:
        asked.append((address, timeout))
        raise ConnectionRefusedError(111, "refused")

    monkeypatch.setattr(socket, "create_connection", refuse)
    for port, tried in ((None, [5025, 5555]), (77, [77])):
        with pytest.raises(DigitizerError) as refusal:
            scpi_links.SocketTransport("scope.lab", port)
        assert asked == [(("scope.lab", one), 3.0) for one in tried]
        name = "oscilloscope at scope.lab" + (":77" if port else "")
        assert refusal.value.what == f"{name} does not answer ([Errno 111] refused)"
        asked.clear()


def test_channels_get_the_usual_roles_in_their_order_unless_they_are_given() -> None:
    for channels, usual in (((4,), ["measurement"]), ((3, 1), ["reference", "measurement"]), ((3, 1, 2), [*Role])):
        assert list(SourceOptions({}).assigned(channels).items()) == list(zip(channels, usual, strict=True))
    given = SourceOptions({"roles": "switch, measurement", "level": " -.5e-2", "depth": "0012", "mass": "0.02"})
    assert given.assigned((1, 2)) == {1: "switch", 2: "measurement"}
    assert (given.number("level", "1"), given.number("none", "+3."), given.whole("depth", "1")) == (-0.005, 3.0, 12)
    assert (given.slope(), SourceOptions({"slope": "falling"}).slope()) == ("rising", "falling")
    rig = given.rig()
    assert rig is not None and (rig.moving_mass_kg, dict(rig.extra)) == (0.02, {})
    for text in ("1e100", "1,2", "0x1", "nan", "1 2", ""):
        with pytest.raises(DigitizerError, match="is no level"):
            SourceOptions({"level": text}).number("level", "0")
    for text in ("12345", "1,2", "-1"):
        with pytest.raises(DigitizerError, match="is no depth number"):
            SourceOptions({"depth": text}).whole("depth", "0")
