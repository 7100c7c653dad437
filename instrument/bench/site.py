"""The site of the simulated rig: its floor vibration, given by a vibration criterion or as measured.

The curves of Gordon ("Generic criteria for vibration-sensitive equipment", SPIE 1619, 1991) state the rms velocity
in every third-octave from 8 to 80 Hz: ISO-office 400 um/s, VC-A 50 um/s, halved at each letter down to VC-G.  A site
named by its criterion has random vibration at the curve's limit, and a pump, a transformer and a fan in proportion.
Outside 8 to 80 Hz the third-octave velocity is proportional to f (below) and to 1/f^2 (above).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from instrument.files import CheckedTable, RecordingError, read_toml, shown

Part = TypeVar("Part")
LEVELS_M_PER_S: Mapping[str, float] = {
    "ISO-office": 400e-6,
    **{f"VC-{letter}": 50e-6 / 2**step for step, letter in enumerate("ABCDEFG")},
}
NAMES = ("quiet", *LEVELS_M_PER_S)
USUAL_SITE = "VC-D"  # default: a good laboratory
LOWEST_LINE_HZ, HIGHEST_LINE_HZ = 0.1, 2000.0


def _check(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{what} is {value:g}: {low:g} to {high:g} can be simulated")


@dataclass(frozen=True, slots=True)
class Line:
    """The vibration of a machine: a sine of ``amplitude_m`` whose phase is drawn anew for every shot."""

    frequency_hz: float
    amplitude_m: float

    def __post_init__(self) -> None:
        if not LOWEST_LINE_HZ <= self.frequency_hz <= HIGHEST_LINE_HZ:
            raise ValueError(f"a line of {self.frequency_hz:g} Hz: {LOWEST_LINE_HZ:g} to {HIGHEST_LINE_HZ:g} Hz")
        _check("the amplitude_m of a line", self.amplitude_m, 0.0, 1e-3)


@dataclass(frozen=True, slots=True)
class Knock:
    """A knock against the table: an oscillation of ``frequency_hz`` that decays with time constant ``decay_s``.

    It starts ``at_s`` after the release of the block (None: at a random time), in a fraction ``share`` of the shots.
    """

    amplitude_m: float
    frequency_hz: float = 60.0
    decay_s: float = 0.01
    at_s: float | None = None
    share: float = 1.0

    def __post_init__(self) -> None:
        _check("the amplitude_m of a knock", self.amplitude_m, 0.0, 1e-3)
        _check("the frequency_hz of a knock", self.frequency_hz, 1.0, 1000.0)
        _check("the decay_s of a knock", self.decay_s, 1e-3, 10.0)
        _check("the share of shots that are knocked", self.share, 0.0, 1.0)
        if self.at_s is not None:
            _check("the at_s of a knock", self.at_s, 0.0, 10.0)


@dataclass(frozen=True, slots=True)
class Site:
    """The vibration of the frame.  ``third_octave_m_per_s`` is the criterion's level, zero without a criterion.

    ``spectrum`` lists pairs of ascending frequency (Hz) and amplitude density of acceleration (m/s2/sqrt(Hz)), as
    measured by an accelerometer on the frame; between them the density is interpolated on logarithmic scales.
    """

    name: str = "quiet"
    third_octave_m_per_s: float = 0.0
    lines: tuple[Line, ...] = ()
    knocks: tuple[Knock, ...] = ()
    spectrum: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        _check("third_octave_m_per_s", self.third_octave_m_per_s, 0.0, 1e-2)
        frequencies = [frequency for frequency, _ in self.spectrum]
        for frequency, density in self.spectrum:
            _check("a frequency of the spectrum", frequency, LOWEST_LINE_HZ, HIGHEST_LINE_HZ)
            _check("a density of the spectrum", density, 1e-15, 10.0)
        if self.spectrum and (len(frequencies) < 2 or sorted(set(frequencies)) != frequencies):
            raise ValueError("a spectrum has at least two frequencies, each above the one before")

    @property
    def moves(self) -> bool:
        """Get whether the frame moves at all."""
        return bool(self.third_octave_m_per_s or self.lines or self.knocks or self.spectrum)


QUIET = Site()


def site_named(text: str) -> Site:
    """Return the site named by ``text``: one of NAMES, or the path of a TOML file that describes a site.

    Raises ValueError, in one line, for an unknown name or a file that cannot be read.
    """
    known = {name.casefold(): name for name in NAMES}.get(text.casefold())
    if known == QUIET.name:
        return QUIET
    if known is not None:
        level = LEVELS_M_PER_S[known]
        size = level / LEVELS_M_PER_S["VC-C"]
        return Site(known, level, (Line(24.9, 40e-9 * size), Line(100.0, 15e-9 * size), Line(296.0, 8e-9 * size)))
    if not text.lower().endswith(".toml"):
        raise ValueError(f"no site is called {shown(text)}; there are {', '.join(NAMES)}, or a TOML file")
    path = Path(text)
    try:
        return _described(CheckedTable(path, read_toml(path)))
    except RecordingError as error:
        raise ValueError(str(error)) from None
    except ValueError as error:  # a value that cannot be simulated
        raise ValueError(f"{path}: {error}") from None


def _described(whole: CheckedTable) -> Site:
    name = whole.text("name") or whole.path.stem
    level = whole.number("third_octave_m_per_s", -math.inf, math.inf) or 0.0
    criterion = whole.text("criterion")
    if criterion is not None:
        if criterion not in LEVELS_M_PER_S or "third_octave_m_per_s" in whole.values:
            raise whole.error_for("criterion", f"is one of {', '.join(LEVELS_M_PER_S)}, without third_octave_m_per_s")
        level = LEVELS_M_PER_S[criterion]
    lines = tuple(_refuse_unknown_keys(table, table.read_dataclass(Line)) for table in whole.objects("line") or ())
    knocks = tuple(_refuse_unknown_keys(table, table.read_dataclass(Knock)) for table in whole.objects("knock") or ())
    table = whole.object("spectrum")
    spectrum = () if table is None else _refuse_unknown_keys(table, _spectrum(table))
    return _refuse_unknown_keys(whole, Site(name, level, lines, knocks, spectrum))


def _refuse_unknown_keys(table: CheckedTable, part: Part) -> Part:
    """Return ``part``, which was read from ``table``; raise RecordingError if the table has an unknown key."""
    for key in table.unread():
        raise table.error_for(key, f"is none of {', '.join(sorted(table.used))}")
    return part


def _spectrum(table: CheckedTable) -> tuple[tuple[float, float], ...]:
    columns = []
    for key in ("frequency_hz", "acceleration_m_per_s2_per_sqrt_hz"):
        values = table.get(key)
        if not isinstance(values, list):
            raise table.error_for(key, "a list of numbers is needed")
        listed = CheckedTable(table.path, {f"{key}[{n}]": value for n, value in enumerate(values)}, table.place)
        columns.append([listed.required(place, -math.inf, math.inf) for place in listed.values])
    frequencies, densities = columns
    if len(frequencies) != len(densities) or not frequencies:
        raise table.error_for("frequency_hz", f"{len(frequencies)} frequencies and {len(densities)} densities")
    return tuple(zip(frequencies, densities, strict=True))
