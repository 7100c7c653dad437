"""Open an oscilloscope by its address: ``usb[:VVVV:PPPP]``, ``HOST[:PORT]`` or a VISA resource name."""

import re
from typing import TYPE_CHECKING, Any

from instrument.devices.digitizer import DigitizerError
from instrument.files import shown

if TYPE_CHECKING:
    from instrument.devices.scpi import ScpiOscilloscope
    from instrument.devices.source_options import SourceOptions

_USB_ADDRESS = re.compile(r"usb(?::([0-9a-f]{4}):([0-9a-f]{4}))?", re.IGNORECASE)
_HOST = re.compile(r"(\[[0-9a-fA-F:.]{2,45}\]|[A-Za-z0-9](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?)(?::(\d{1,5}))?")
_VISA = re.compile(r"[A-Za-z0-9]+(?:::[A-Za-z0-9._,\[\]:-]+)+")
_OPTIONS = re.compile(r"[A-Za-z]+=[^\s&?]+(?:&[A-Za-z]+=[^\s&?]+)*")
_REMEDY = "type HOST or HOST:PORT, as 192.168.1.5 or scope.lab:5025, or a VISA name; options as ?trigger=3 may follow"


def network_source(typed: str) -> str:
    """Return the source text of an address typed by the operator, without connecting.

    Raises DigitizerError for text that is not an address.
    """
    text = typed.strip()
    text = text[5:] if text.lower().startswith("scpi:") else text
    address, question_mark, options = text.partition("?")
    if not (_host_of(address) or _VISA.fullmatch(address)):
        raise DigitizerError(f"{shown(text)} is no address" if text else "no address was given", _REMEDY)
    if address.lower() == "usb":
        raise DigitizerError("an oscilloscope on USB is found by itself", "plug it in and look again")
    if question_mark and not _OPTIONS.fullmatch(options):
        raise DigitizerError(f"{shown(options)} are no options", _REMEDY)
    return f"scpi:{text}"


def _host_of(address: str) -> tuple[str, int | None] | None:
    """Return host and port (None: try the usual ports) of ``HOST[:PORT]``; None if ``address`` has another form."""
    host = _HOST.fullmatch(address)
    port = int(host[2]) if host and host[2] else None
    return (host[1], port) if host and (port is None or 0 < port < 65536) else None


def network_name(source: str) -> str:
    """Return the name shown on the screen for a source of ``network_source``."""
    return f"Oscilloscope at {source.removeprefix('scpi:').partition('?')[0]}"


def open_digitizer(address: str, options: "SourceOptions") -> "ScpiOscilloscope":
    from instrument.devices.scpi import EXTERNAL, ScpiOscilloscope
    from instrument.devices.triggered_digitizer import HardwareTrigger

    roles = options.assigned(options.wholes("channels", "1,2", "channel"))
    source: int | str | None = None
    if "trigger" in options:
        source = EXTERNAL if options.text("trigger", "") == EXTERNAL else options.whole("trigger", "")
    trigger = HardwareTrigger(source, options.slope(), options.number("level", "") if "level" in options else None)
    rig = options.rig()  # all options are read before the instrument is opened
    return ScpiOscilloscope(_link(address), roles, trigger, setup=rig)


def _link(address: str) -> Any:
    """Open the SCPI link of an ``address``: ``usb[:VVVV:PPPP]``, ``HOST[:PORT]`` or a VISA resource name."""
    if usb_address := _USB_ADDRESS.fullmatch(address):
        from instrument.devices.usbtmc import UsbtmcTransport, find_instruments

        wanted = tuple(int(part, 16) for part in usb_address.groups() if part)
        devices = [d for d in find_instruments() if not wanted or (d.idVendor, d.idProduct) == wanted]
        if not devices:
            raise DigitizerError(f"no oscilloscope at {address}", "plug it in, and set its USB device port to USBTMC")
        return UsbtmcTransport(devices[0])
    if "::" in address and not address.startswith("["):
        from instrument.devices.scpi_visa import VisaTransport

        return VisaTransport(address)
    if found := _host_of(address):
        from instrument.devices.scpi_socket import SocketTransport

        host, port = found
        return SocketTransport(host.strip("[]"), port)
    raise DigitizerError(
        f"{shown(address)} is no address of an oscilloscope", "give HOST, HOST:PORT, usb or a VISA resource name"
    )
