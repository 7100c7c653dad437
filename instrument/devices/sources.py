"""Where samples come from: each source is one row, and ``--source``, the window's list and the set-up follow from it.

A source is named ``NAME``, or ``NAME:ADDRESS`` where it has an address; options follow a question mark, as in
``hantek6022?roles=switch,measurement&gains=1,5`` or ``scpi:192.168.1.5?channels=1,2&trigger=3&slope=falling``.
``bench?effect=quadratic_drag`` is a simulated rig with what the base model lacks, ``seed`` another one,
``bench?site=VC-D`` one in a building; ``bench?speed=0.45&added=0.05&first=3`` is pushed to this speed (m/s) with so
much more on the block (kg), the first push being the fourth of its seed.  Devices take what is known of the rig:
``mass`` (kg), ``rest`` (the rest frequency in Hz, needed where no channel carries PD0) and ``wavelength`` (in air, m).

How to add one: docs/add-a-digitizer.md.
"""

import importlib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

if TYPE_CHECKING:
    from analysis.shot.recording import Setup
    from instrument.devices.digitizer import Digitizer

_RIG = ("mass", "rest", "wavelength")
PUSH = ("speed", "added", "first")


@dataclass(frozen=True, slots=True)
class Source:
    """A kind of digitizer; what opens and finds it is named "folder.module:function" and imported only then.

    ``opened`` takes the address and a ``SourceOptions`` and returns the digitizer; ``found`` takes a USB backend (None:
    the system's) and returns what is plugged in.  ``listed`` are the texts that the window always offers, with their
    words; one that ends with a colon is asked for.
    """

    name: str
    opened: str
    address: str = ""  # what must follow the colon; "": nothing may
    options: tuple[str, ...] = ()  # a source without any takes all that follows the colon for its address
    found: str = ""
    listed: dict[str, str] = field(default_factory=dict)
    simulated: bool = False  # it waits for the processor alone, and is never late by itself
    knows_its_rig: bool = False  # brings mass and wavelength along: the settings' are not asked
    in_subprocess: bool = True
    remembered: bool = True  # opened at the next start, too

    @property
    def text(self) -> str:
        """Get how it is written: "scpi:ADDRESS"."""
        return f"{self.name}:{self.address}" if self.address else self.name


SOURCES = (
    Source(
        "bench",
        "bench.digitizer:opened",
        options=("effect", "seed", "site", *PUSH),
        listed={  # the effect is not named on the screen: it is to be found
            "bench": "Simulated bench",
            "bench?effect=quadratic_drag:coefficient_n_s2_per_m2=2e-4": "Simulated bench with a flaw",
        },
        simulated=True,
        knows_its_rig=True,
    ),
    Source(
        "replay",
        "devices.replay:opened",
        "PATH",
        listed={"replay:": "Play a recording …"},
        knows_its_rig=True,
        in_subprocess=False,  # it waits for its reader and can lose nothing
        remembered=False,
    ),
    Source(
        "hantek6022",
        "devices.hantek6022:opened",
        options=("roles", "gains", "firmware", *_RIG),
        found="devices.found_devices:hantek6022",
    ),
    Source(
        "scpi",
        "devices.scpi_address:opened",
        "ADDRESS",
        options=("channels", "roles", "trigger", "slope", "level", *_RIG),
        found="devices.found_devices:oscilloscopes",
    ),
    Source(
        "niscope",
        "devices.niscope_card:opened",
        "RESOURCE",
        options=("channels", "roles", "trigger", "slope", "level", "range", *_RIG),
        found="devices.found_devices:ni_cards",
    ),
)


def source_of(text: str) -> Source:
    """Return the kind of source that a text names; one without a name where it names none."""
    name = re.split("[:?]", text.strip(), maxsplit=1)[0].lower()
    return next((source for source in SOURCES if source.name == name), Source("", ""))


def listed_sources() -> list[tuple[str, str]]:
    """Return the sources that the window always offers, each as it is written and in words."""
    return [item for source in SOURCES for item in source.listed.items()]


def source_words() -> str:
    """Return all sources as they are written."""
    texts = [source.text for source in SOURCES]
    return f"{', '.join(texts[:-1])} or {texts[-1]}"


def open_source(text: str, *, setup: "Setup | None" = None) -> "Digitizer":
    """Open the digitizer that ``text`` names.  ``setup`` is the rig as the operator gave it, handed to real devices.

    Raises DigitizerError, in one line, for an unknown source, a wrong option or a device that cannot be opened.
    """
    from instrument.devices.digitizer import DigitizerError
    from instrument.devices.source_options import SourceOptions

    source = source_of(text)
    rest = text.strip()[len(source.name) :]
    remedy = f"use one of {', '.join(source.text for source in SOURCES)}"
    if not source.name or (source.address and (not rest.startswith(":") or rest == ":")):
        raise DigitizerError(f"unknown source {text[:80]!r}", remedy)
    rest = rest.removeprefix(":")
    if not source.address and rest and not rest.startswith("?"):
        raise DigitizerError(f"source {source.name} takes no address, but got {rest[:80]!r}", remedy)
    address, _, given = rest.partition("?") if source.options else (rest, "", "")
    options = SourceOptions.read(given, source.name, source.options, setup)
    digitizer: Digitizer = imported(source.opened)(address, options)
    return digitizer


def imported(name: str) -> Any:
    """Return the function that "folder.module:function" names.  Raises DigitizerError where a package is missing."""
    from instrument.devices.digitizer import DigitizerError

    module, _, function = name.partition(":")
    try:
        return getattr(importlib.import_module(f"..{module}", __package__), function)
    except ModuleNotFoundError as error:
        raise DigitizerError(f"this source needs {error.name}, which is not installed", "reinstall Levimass") from error


def is_bench(source: str) -> bool:
    """Return whether the text of a source names the simulated bench."""
    return source.strip().partition("?")[0].lower() == "bench"


def pushed(source: str, speed_m_per_s: float, added_kg: float, first: int) -> str:
    """Return the text of a simulated bench's source with its push set: speed, weights on the block, which push it is.

    Nothing else of the bench changes, nothing of what is wrong with it is told.
    """
    kind, _, rest = source.strip().partition("?")
    kept = [item for item in rest.split("&") if item and item.partition("=")[0] not in PUSH]
    push = [f"speed={speed_m_per_s:.4f}", f"added={added_kg:.5f}", f"first={first}"]
    return f"{kind}?{'&'.join([*kept, *push])}"


def at_site(source: str, site: str) -> str:
    """Return the text of a source with its bench at ``site``; of another source, or one that says where, unchanged."""
    if not is_bench(source) or re.search("[?&]site=", source):
        return source
    return f"{source}{'&' if '?' in source else '?'}site={quote(site)}"
