"""The table of sample sources; ``--source``, the window's list and the guided set-up are generated from its rows.

A source is written ``NAME`` or, with an address, ``NAME:ADDRESS``; options follow a question mark, as in
``hantek6022?roles=switch,measurement&gains=1,5`` or ``scpi:192.168.1.5?channels=1,2&trigger=3&slope=falling``.
``bench?effect=quadratic_drag`` is a simulated rig with an effect that the base model lacks, ``seed`` sets its random
numbers, and ``bench?site=VC-D`` puts it in a building.  ``bench?speed=0.45&added=0.05&first=3`` sets the speed of a
push (m/s) and the mass added to the block (kg), and starts with the fourth push of its seed.  Devices accept options
for the set-up: ``mass`` (kg), ``rest`` (the rest frequency in Hz, needed if no channel carries PD0) and ``wavelength``
(in air, m).

How to add one: docs/add-a-digitizer.md.
"""

import importlib
import re
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

from instrument.devices.digitizer import Digitizer, DigitizerError
from instrument.devices.source_options import RIG, SourceOptions
from instrument.files import shown

PUSH = ("speed", "added", "first")


@dataclass(frozen=True, slots=True)
class Source:
    """A kind of digitizer.  ``opener`` and ``finder`` are names "folder.module:function", imported when needed.

    ``opener`` takes the address and a ``SourceOptions`` and returns the digitizer.  ``finder`` takes a USB backend
    (None: the system's) and returns the devices plugged in.  ``listed`` maps the sources that the window always offers
    to their names on the screen; for a source that ends with a colon the window asks for the address.
    """

    name: str
    opener: str
    address: str = ""  # name of the address that follows the colon; "": no address
    options: tuple[str, ...] = ()  # if there are none, everything after the colon is the address
    finder: str = ""
    listed: dict[str, str] = field(default_factory=dict)
    simulated: bool = False  # True: only a busy computer can delay it
    states_setup: bool = False  # True: mass and wavelength come from the source, not from the settings
    in_subprocess: bool = True
    remembered: bool = True  # True: opened again at the next start

    @property
    def text(self) -> str:
        """Get the form of the source's text: "scpi:ADDRESS"."""
        return f"{self.name}:{self.address}" if self.address else self.name


SOURCES = (
    Source(
        "bench",
        "bench:open_digitizer",
        options=("effect", "seed", "site", *PUSH),
        listed={  # the effect is not named on the screen, as finding it is the user's task
            "bench": "Simulated bench",
            "bench?effect=quadratic_drag:coefficient_n_s2_per_m2=3e-3": "Simulated bench with a flaw",
        },
        simulated=True,
        states_setup=True,
    ),
    Source(
        "replay",
        "devices.replay:open_digitizer",
        "PATH",
        listed={"replay:": "Play a recording …"},
        states_setup=True,
        in_subprocess=False,  # not needed, as it waits for its reader and cannot lose samples
        remembered=False,
    ),
    Source(
        "hantek6022",
        "devices.hantek6022:open_digitizer",
        options=("roles", "gains", "firmware", *RIG),
        finder="devices.device_search:hantek6022",
    ),
    Source(
        "scpi",
        "devices.scpi:open_digitizer",
        "ADDRESS",
        options=("channels", "roles", "trigger", "slope", "level", *RIG),
        finder="devices.device_search:oscilloscopes",
    ),
    Source(
        "niscope",
        "devices.niscope_card:open_digitizer",
        "RESOURCE",
        options=("channels", "roles", "trigger", "slope", "level", "range", *RIG),
        finder="devices.device_search:ni_cards",
    ),
)


def source_of(text: str) -> Source:
    """Return the row of a source's text; for an unknown source, a row without a name."""
    name = re.split("[:?]", text.strip())[0].lower()
    return next((source for source in SOURCES if source.name == name), Source("", ""))


def listed_sources() -> list[tuple[str, str]]:
    """Return (text, name on the screen) of each source that the window always offers."""
    return [item for source in SOURCES for item in source.listed.items()]


def source_words() -> str:
    """Return the forms of all sources as one line: "bench, replay:PATH, ..."."""
    texts = [source.text for source in SOURCES]
    return f"{', '.join(texts[:-1])} or {texts[-1]}"


def open_source(text: str) -> Digitizer:
    """Open the digitizer of a source's ``text``.  Raises DigitizerError, also for an invalid source or option."""
    source = source_of(text)
    rest = text.strip()[len(source.name) :]
    remedy = f"use one of {', '.join(source.text for source in SOURCES)}"
    if not source.name or (source.address and (not rest.startswith(":") or rest == ":")):
        raise DigitizerError(f"unknown source {shown(text)}", remedy)
    rest = rest.removeprefix(":")
    if not source.address and rest and not rest.startswith("?"):
        raise DigitizerError(f"source {source.name} takes no address, but got {shown(rest)}", remedy)
    address, _, given = rest.partition("?") if source.options else (rest, "", "")
    options = SourceOptions.read(given, source.name, source.options)
    digitizer: Digitizer = import_function(source.opener)(address, options)
    return digitizer


def import_function(name: str) -> Any:
    """Return the function named "folder.module:function".  Raises DigitizerError if a package is missing."""
    module, _, function = name.partition(":")
    try:
        return getattr(importlib.import_module(f"..{module}", __package__), function)
    except ModuleNotFoundError as error:
        raise DigitizerError(f"this source needs {error.name}, which is not installed", "reinstall Levimass") from error


def is_bench(source: str) -> bool:
    """Return whether a source's text is that of the simulated bench."""
    return source.strip().partition("?")[0].lower() == "bench"


def with_push(source: str, speed_m_per_s: float, added_kg: float, first: int) -> str:
    """Return a simulated bench's source with speed, added mass and number of its first push; other options are kept."""
    kind, _, rest = source.strip().partition("?")
    kept = [item for item in rest.split("&") if item and item.partition("=")[0] not in PUSH]
    push = [f"speed={speed_m_per_s:.4f}", f"added={added_kg:.5f}", f"first={first}"]
    return f"{kind}?{'&'.join([*kept, *push])}"


def with_site(source: str, site: str) -> str:
    """Return a source's text with ``site`` added; unchanged if it has a site or is not the simulated bench."""
    if not is_bench(source) or re.search("[?&]site=", source):
        return source
    return f"{source}{'&' if '?' in source else '?'}site={quote(site)}"
