"""From what a person types to an oscilloscope in the network: no bus lists those, so that somebody has to say where."""

import re

from instrument.digitizer import DigitizerError

_HOST = re.compile(r"(\[[0-9a-fA-F:.]{2,45}\]|[A-Za-z0-9](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9])?)(?::(\d{1,5}))?")
_VISA = re.compile(r"[A-Za-z0-9]+(?:::[A-Za-z0-9._,\[\]:-]+)+")
_OPTIONS = re.compile(r"[A-Za-z]+=[^\s&?]+(?:&[A-Za-z]+=[^\s&?]+)*")
_REMEDY = "type HOST or HOST:PORT, as 192.168.1.5 or scope.lab:5025, or a VISA name; options as ?trigger=3 may follow"


def network_source(typed: str) -> str:
    """Return the source that a typed address means, for ``open_source``; connects to nothing.

    Raises DigitizerError, in one line, for what can be no address.
    """
    text = typed.strip()
    text = text[5:] if text.lower().startswith("scpi:") else text
    address, asked, options = text.partition("?")
    host = _HOST.fullmatch(address)
    port = int(host[2]) if host is not None and host[2] else 1
    if not ((host is not None and 0 < port < 65536) or _VISA.fullmatch(address)):
        raise DigitizerError(f"{text[:60]!r} is no address" if text else "no address was given", _REMEDY)
    if address.lower() == "usb":
        raise DigitizerError("an oscilloscope on USB is found by itself", "plug it in and look again")
    if asked and not _OPTIONS.fullmatch(options):
        raise DigitizerError(f"{options[:60]!r} are no options", _REMEDY)
    return f"scpi:{text}"


def network_name(source: str) -> str:
    """Return the words for such a source."""
    return f"Oscilloscope at {source.removeprefix('scpi:').partition('?')[0]}"
