"""From the text of ``--source`` to a digitizer.

``bench`` · ``replay:PATH`` · ``hantek6022`` · ``scpi:ADDRESS`` · ``niscope:RESOURCE``, all but the second with options
after a question mark, for example ``hantek6022?roles=switch,measurement&gains=1,5`` or
``scpi:192.168.1.5?channels=1,2&trigger=3&slope=falling&level=1.2``.  ``bench?effect=quadratic_drag`` is a simulated
rig with what the base model lacks, ``seed`` another one, ``bench?site=VC-D`` one in a building;
``bench?speed=0.45&added=0.05&first=3`` is pushed to this speed (m/s) with so much more on the block (kg), the first
push being the fourth of its seed.  The last three sources take what is known of the rig: ``mass`` (kg), ``rest`` (the
rest frequency in Hz, needed where no channel carries PD0) and ``wavelength`` (in air, m).
"""

import importlib
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from analysis.shot.recording import Role, Setup
from instrument.bench.site import QUIET, site_named
from instrument.digitizer import Digitizer, DigitizerError
from instrument.drivers.assumed_rig import assumed_rig
from instrument.found_devices import FoundDevice, found_devices

__all__ = ["SOURCES", "FoundDevice", "at_site", "found_devices", "is_bench", "open_source", "pushed"]

SOURCES = ("bench", "replay:PATH", "hantek6022", "scpi:ADDRESS", "niscope:RESOURCE")
_RIG = ("mass", "rest", "wavelength")
_PUSH = ("speed", "added", "first")
_SET_SPREAD = 0.02  # part by which a push that was set is off
_REMEDY = "use one of " + ", ".join(SOURCES)

_USB_ADDRESS = re.compile(r"usb(?::([0-9a-f]{4}):([0-9a-f]{4}))?", re.IGNORECASE)
_HOST_ADDRESS = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9][A-Za-z0-9._-]*)(?::(\d{1,5}))?")


def open_source(text: str, *, setup: Setup | None = None) -> Digitizer:
    """Open the digitizer that ``text`` names.  ``setup`` is the rig as the operator gave it, handed to real devices.

    Raises DigitizerError, in one line, for an unknown source, a wrong option or a device that cannot be opened.
    """
    kind, colon, rest = text.strip().partition(":")
    if "?" in kind:
        kind, _, rest = text.strip().partition("?")
        rest = "?" + rest
    opener = _OPENERS.get(kind.lower())
    if opener is None or (kind.lower() in ("replay", "scpi", "niscope") and not (colon and rest)):
        raise DigitizerError(f"unknown source {text[:80]!r}", _REMEDY)
    if kind.lower() in ("bench", "hantek6022") and rest and not rest.startswith("?"):
        raise DigitizerError(f"source {kind} takes no address, but got {rest[:80]!r}", _REMEDY)
    return opener(rest, setup)


def is_bench(source: str) -> bool:
    """Return whether the text of a source names the simulated bench."""
    return source.strip().partition("?")[0].lower() == "bench"


def pushed(source: str, speed_m_per_s: float, added_kg: float, first: int) -> str:
    """Return the text of a simulated bench's source with its push set: speed, weights on the block, which push it is.

    Nothing else of the bench changes, nothing of what is wrong with it is told.
    """
    kind, _, rest = source.strip().partition("?")
    kept = [item for item in rest.split("&") if item and item.partition("=")[0] not in _PUSH]
    push = [f"speed={speed_m_per_s:.4f}", f"added={added_kg:.5f}", f"first={first}"]
    return f"{kind}?{'&'.join([*kept, *push])}"


def at_site(source: str, site: str) -> str:
    """Return the text of a source with its bench at ``site``; of another source, or one that says where, unchanged."""
    if not is_bench(source) or re.search("[?&]site=", source):
        return source
    return f"{source}{'&' if '?' in source else '?'}site={quote(site)}"


def _bench(rest: str, setup: Setup | None) -> Digitizer:
    options = _options(rest.removeprefix("?"), "bench", ("effect", "seed", "site", *_PUSH))
    try:
        effects = _imported("instrument.bench.effects").parse(options["effect"]) if "effect" in options else {}
    except ValueError as error:
        raise DigitizerError(f"source bench: {error}", "leave the effect out, or name one of these") from error
    try:
        site = site_named(options.get("site", QUIET.name))
    except ValueError as error:
        raise DigitizerError(f"source bench: {error}", "leave the site out, or name another") from error
    seed = _integer(options.get("seed", "1"), "seed")
    push: dict[str, float] = {}
    if "speed" in options:  # one who sets it takes more care than one who just pushes
        push = {"velocity_m_per_s": _number(options["speed"], "speed"), "velocity_spread": _SET_SPREAD}
    if "added" in options:
        push["added_kg"] = _number(options["added"], "added mass")
    try:
        rig = _imported("instrument.bench.bench").Bench(effects=effects, site=site, seed=seed, **push)
    except ValueError as error:
        raise DigitizerError(f"source bench: {error}", "set another speed or less weight") from error
    first = _integer(options.get("first", "0"), "first push")
    # patient: a shot of the simulated rig with holes in it, because the computer is busy, teaches nobody anything
    bench: Digitizer = _imported("instrument.bench.digitizer").BenchDigitizer(rig, patient=True, first_shot=first)
    return bench


def _replay(rest: str, setup: Setup | None) -> Digitizer:
    path = Path(rest)
    if not path.exists():
        raise DigitizerError(f"nothing to replay at {rest}", "name a recording, or a folder that holds some")
    replay: Digitizer = _imported("instrument.replay").ReplayDigitizer([path])
    return replay


def _hantek6022(rest: str, setup: Setup | None) -> Digitizer:
    from instrument.drivers.hantek6022 import Hantek6022

    options = _options(rest.removeprefix("?"), "hantek6022", ("roles", "gains", "firmware", *_RIG))
    firmware = options.get("firmware")
    return Hantek6022(
        _roles(options.get("roles", "reference,measurement")),
        tuple(_integer(gain, "gain") for gain in options.get("gains", "2,2").split(",")),
        firmware=Path(firmware) if firmware else None,
        setup=_rig(options, setup, 8),
    )


def _scpi(rest: str, setup: Setup | None) -> Digitizer:
    from instrument.drivers.scpi import EXTERNAL, HardwareTrigger, ScpiOscilloscope

    address, _, given = rest.partition("?")
    options = _options(given, "scpi", ("channels", "roles", "trigger", "slope", "level", *_RIG))
    channels = [_integer(n, "channel") for n in options.get("channels", "1,2").split(",")]
    roles = _assigned(channels, options)
    source: int | str | None = options.get("trigger")
    if isinstance(source, str) and source != EXTERNAL:
        source = _integer(source, "trigger")
    level = options.get("level")
    trigger = HardwareTrigger(source, _slope(options), None if level is None else _number(level, "level"))
    return ScpiOscilloscope(open_link(address), roles, trigger, setup=_rig(options, setup, None))


def open_link(address: str) -> Any:
    """Open the SCPI link that ``address`` names: ``usb[:VVVV:PPPP]``, ``HOST[:PORT]`` or a VISA resource name."""
    if usb_address := _USB_ADDRESS.fullmatch(address):
        from instrument.drivers.usbtmc import UsbtmcTransport, find_instruments

        wanted = tuple(int(part, 16) for part in usb_address.groups() if part)
        devices = [d for d in find_instruments() if not wanted or (d.idVendor, d.idProduct) == wanted]
        if not devices:
            raise DigitizerError(f"no oscilloscope at {address}", "plug it in, and set its USB device port to USBTMC")
        return UsbtmcTransport(devices[0])
    if "::" in address and not address.startswith("["):
        from instrument.drivers.scpi_visa import VisaTransport

        return VisaTransport(address)
    if host := _HOST_ADDRESS.fullmatch(address):
        from instrument.drivers.scpi_socket import SocketTransport

        port = int(host[2]) if host[2] else None
        if port is None or 0 < port < 65536:
            return SocketTransport(host[1].strip("[]"), port)
    raise DigitizerError(
        f"{address[:80]!r} is no address of an oscilloscope", "give HOST, HOST:PORT, usb or a VISA resource name"
    )


def _niscope(rest: str, setup: Setup | None) -> Digitizer:
    from instrument.drivers.niscope_card import CardTrigger, NiscopeCard

    resource, _, given = rest.partition("?")
    options = _options(given, "niscope", ("channels", "roles", "trigger", "slope", "level", "range", *_RIG))
    channels = [str(_integer(n, "channel")) for n in options.get("channels", "0,1").split(",")]
    trigger = CardTrigger(options.get("trigger", "2"), _number(options.get("level", "1"), "level"), _slope(options))
    range_v = _number(options.get("range", "2"), "range")
    return NiscopeCard(resource, _assigned(channels, options), trigger, range_v=range_v, setup=_rig(options, setup, 16))


_OPENERS: Mapping[str, Callable[[str, Setup | None], Digitizer]] = {
    "bench": _bench,
    "replay": _replay,
    "hantek6022": _hantek6022,
    "scpi": _scpi,
    "niscope": _niscope,
}


def _imported(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise DigitizerError(f"this source needs {error.name}, which is not installed", "reinstall Levimass") from error


def _options(given: str, source: str, known: tuple[str, ...]) -> dict[str, str]:
    options = {}
    for item in filter(None, given.split("&")):
        name, equals, value = item.partition("=")
        if name not in known or not equals or not value:
            raise DigitizerError(f"source {source}: {item[:60]!r} is no option", f"known are {', '.join(known)}")
        options[name] = unquote(value)
    return options


def _roles(text: str) -> tuple[Role, ...]:
    try:
        return tuple(Role(name.strip()) for name in text.split(","))
    except ValueError as error:
        known = ", ".join(Role)
        raise DigitizerError(f"roles={text[:60]} names an unknown role", f"known are {known}") from error


def _assigned(channels: list[Any], options: Mapping[str, str]) -> dict[Any, Role]:
    default = ",".join(("reference", "measurement", "switch")[: len(channels)]) if len(channels) > 1 else "measurement"
    roles = _roles(options.get("roles", default))
    if len(roles) != len(channels) or len(set(channels)) != len(channels):
        raise DigitizerError("channels and roles must name each channel once and be equally many")
    return dict(zip(channels, roles, strict=True))


def _rig(options: Mapping[str, str], setup: Setup | None, bits: int | None) -> Setup | None:
    """Return ``setup`` with what the options say of the rig; None where neither says anything."""
    given: dict[str, float] = {}
    for name, key in (("mass", "moving_mass_kg"), ("rest", "rest_frequency_hz"), ("wavelength", "wavelength_air_m")):
        if name in options:
            given[key] = _number(options[name], name)
            if given[key] <= 0:
                raise DigitizerError(f"{name}={options[name][:40]} is not above zero")
    if not given:
        return setup
    rig = setup or assumed_rig(bits or 16)
    if "mass" in options:
        rig = replace(rig, extra={key: value for key, value in rig.extra.items() if key != "moving_mass_assumed"})
    return replace(rig, **given)  # type: ignore[arg-type]


def _slope(options: Mapping[str, str]) -> str:
    slope = options.get("slope", "rising")
    if slope not in ("rising", "falling"):
        raise DigitizerError(f"slope={slope[:40]} is neither rising nor falling")
    return slope


def _integer(text: str, what: str) -> int:
    if not re.fullmatch(r"\d{1,4}", text.strip()):
        raise DigitizerError(f"{text[:40]!r} is no {what} number")
    return int(text)


def _number(text: str, what: str) -> float:
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?", text.strip()):
        raise DigitizerError(f"{text[:40]!r} is no {what}")
    return float(text)
