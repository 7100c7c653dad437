"""The SCPI commands of each maker's oscilloscopes, as a table used by the SCPI driver.

Sources: the programming guides of Rigol MSO1000Z/DS1000Z, Siglent SDS1000X-E and Keysight InfiniiVision.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from instrument.devices.digitizer import DigitizerError
from instrument.files import shown

Query = Callable[[str], str]


class ImplausibleAnswer(DigitizerError):
    """An instrument's answer contains impossible numbers."""


@dataclass(frozen=True, slots=True)
class Timing:
    """The sample rate, number of samples and trigger position of a shot."""

    sample_rate_hz: float
    samples: int
    trigger_sample: int | None


@dataclass(frozen=True, slots=True)
class Scaling:
    """volts = count * volts_per_count + offset_v, for counts as ``Dialect.decode`` returns them.

    Raises ImplausibleAnswer for values that no instrument has.
    """

    volts_per_count: float
    offset_v: float

    def __post_init__(self) -> None:
        if not (1e-12 < abs(self.volts_per_count) < 1e4 and abs(self.offset_v) < 1e6):
            raise ImplausibleAnswer(
                f"the oscilloscope reports {self.volts_per_count:g} V per count and an offset of {self.offset_v:g} V",
                "set the vertical scale anew, then re-arm",
            )


@dataclass(frozen=True, slots=True)
class Dialect:
    """The SCPI commands of one maker.

    Placeholders: ``{n}`` a channel; ``{a}`` and ``{b}`` the first and last point (from 1); ``{count}`` the number of
    points and ``{skip}`` the number of points before them; ``{source}`` the trigger's channel.
    """

    name: str
    makers: tuple[str, ...]  # beginnings of the answer to *IDN?, in capitals
    bits: int
    bytes_per_sample: int
    points_per_read: int | None  # None: the whole memory in one block
    begin: tuple[str, ...]  # sent once, after opening
    trigger_channel: tuple[str, ...]
    trigger_external: tuple[str, ...]
    slope: dict[str, str]
    level: str
    single: tuple[str, ...]
    status: str
    is_done: Callable[[str], bool]
    stop: str
    depths: tuple[int, ...]  # memory depths per channel with two channels on; empty: chosen by the instrument
    set_depth: str
    divisions: int
    set_time_per_division: str
    set_trigger_delay: str  # time in s from the trigger to the middle of the record
    max_samples: int
    set_now: Callable[[Query, int], Timing]  # (query, channel) -> timing of the next shot, from the settings
    timing: Callable[[Query, int], Timing]  # (query, channel) -> timing of the shot in memory
    select: tuple[str, ...]  # sent before a channel's points are read
    scaling: Callable[[Query, int], Scaling]
    fetch: tuple[str, ...]  # the answer to the last command is the block
    decode: Callable[[bytes], NDArray[np.int16]]


def numbers(answer: str, count: int, what: str) -> list[float]:
    """Return the first ``count`` numbers of an answer.  Raises DigitizerError if they are fewer or not finite."""
    try:
        found = [_number(part) for part in answer.split(",")]
    except ValueError:
        found = []
    if len(found) < count or not all(math.isfinite(value) for value in found[:count]):
        raise DigitizerError(f"the oscilloscope answered {shown(answer)} where {what} is due", "re-arm")
    return found[:count]


def _number(text: str) -> float:
    """Parse a number that may have an SI prefix and unit: ``1.00E+09``, ``500MSa/s``, ``2.00mV``."""
    text = text.strip()
    end = len(text)
    while end and not text[end - 1].isdigit() and text[end - 1] != ".":
        end -= 1
    factor = {"M": 1e6, "G": 1e9, "k": 1e3, "K": 1e3, "m": 1e-3, "u": 1e-6, "n": 1e-9}.get(text[end : end + 1], 1.0)
    return float(text[:end]) * factor


def _timing(rate_hz: float, samples: float, trigger_sample: float) -> Timing:
    if not (1e-3 <= rate_hz <= 1e12 and 1 <= samples <= 1 << 31):
        what = f"the oscilloscope reports {samples:g} samples at {rate_hz:g} a second"
        raise ImplausibleAnswer(what, "set its time base anew")
    return Timing(rate_hz, int(samples), round(trigger_sample) if 0 <= trigger_sample < samples - 0.5 else None)


def _preamble_timing(query: Query, channel: int) -> Timing:
    _, _, points, _, step_s, origin_s, reference, *_ = numbers(query(":WAV:PRE?"), 10, "the waveform's preamble")
    if step_s <= 0.0:
        raise ImplausibleAnswer(f"the oscilloscope reports a sample every {step_s:g} s", "set its time base anew")
    return _timing(1 / step_s, points, reference - origin_s / step_s)


def _rigol_set_now(query: Query, channel: int) -> Timing:
    (rate,) = numbers(query(":ACQ:SRAT?"), 1, "the sample rate")
    (delay,) = numbers(query(":TIM:MAIN:OFFS?"), 1, "the trigger delay")
    depth = query(":ACQ:MDEP?")
    if depth.upper() == "AUTO":
        samples = 12 * rate * numbers(query(":TIM:MAIN:SCAL?"), 1, "the time base")[0]
    else:
        (samples,) = numbers(depth, 1, "the memory depth")
    return _timing(rate, samples, samples / 2 - delay * rate)


def _keysight_set_now(query: Query, channel: int) -> Timing:
    (rate,) = numbers(query(":ACQ:SRAT?"), 1, "the sample rate")
    (length_s,) = numbers(query(":TIM:RANG?"), 1, "the time range")
    (delay,) = numbers(query(":TIM:POS?"), 1, "the trigger delay")
    samples = rate * length_s
    return _timing(rate, samples, samples / 2 - delay * rate)


def _rigol_scaling(query: Query, channel: int) -> Scaling:
    volts, origin, reference = numbers(query(":WAV:PRE?"), 10, "the waveform's preamble")[7:]
    return Scaling(volts, (128 - origin - reference) * volts)


def _keysight_scaling(query: Query, channel: int) -> Scaling:
    volts, origin_v, reference = numbers(query(":WAV:PRE?"), 10, "the waveform's preamble")[7:]
    return Scaling(volts, origin_v - reference * volts)


def _siglent_scaling(query: Query, channel: int) -> Scaling:
    (per_division,) = numbers(query(f"C{channel}:VDIV?"), 1, "the volts a division")
    (offset,) = numbers(query(f"C{channel}:OFST?"), 1, "the offset")
    return Scaling(per_division / 25, -offset)


def _siglent_timing(query: Query, channel: int) -> Timing:
    (rate,) = numbers(query("SARA?"), 1, "the sample rate")
    (samples,) = numbers(query(f"SANU? C{channel}"), 1, "the number of samples")
    (delay,) = numbers(query("TRDL?"), 1, "the trigger delay")
    return _timing(rate, samples, samples / 2 - delay * rate)


def _from_unsigned(block: bytes) -> NDArray[np.int16]:
    return np.frombuffer(block, np.uint8).astype(np.int16) - np.int16(128)


def _from_signed(block: bytes) -> NDArray[np.int16]:
    return np.frombuffer(block, np.int8).astype(np.int16)


def _from_words(block: bytes) -> NDArray[np.int16]:
    return np.frombuffer(block[: len(block) // 2 * 2], "<i2").astype(np.int16)


RIGOL = Dialect(
    name="Rigol DS1000Z",
    makers=("RIGOL",),
    bits=8,
    bytes_per_sample=1,
    points_per_read=250_000,
    begin=(":WAV:MODE RAW", ":WAV:FORM BYTE"),
    trigger_channel=(":TRIG:MODE EDGE", ":TRIG:EDG:SOUR CHAN{n}"),
    trigger_external=(":TRIG:MODE EDGE", ":TRIG:EDG:SOUR EXT"),
    slope={"rising": ":TRIG:EDG:SLOP POS", "falling": ":TRIG:EDG:SLOP NEG"},
    level=":TRIG:EDG:LEV {volts:g}",
    single=(":SING",),
    status=":TRIG:STAT?",
    is_done=lambda answer: answer.upper() == "STOP",
    stop=":STOP",
    depths=(6_000, 60_000, 600_000, 6_000_000, 12_000_000),
    set_depth=":ACQ:MDEP {samples}",
    divisions=12,
    set_time_per_division=":TIM:MAIN:SCAL {seconds:.9g}",
    set_trigger_delay=":TIM:MAIN:OFFS {seconds:.9g}",
    max_samples=12_000_000,
    set_now=_rigol_set_now,
    timing=_rigol_set_now,  # not the preamble, whose points and origin are those of the last part read
    select=(":WAV:SOUR CHAN{n}",),
    scaling=_rigol_scaling,
    fetch=(":WAV:STAR {a}", ":WAV:STOP {b}", ":WAV:DATA?"),
    decode=_from_unsigned,
)

SIGLENT = Dialect(
    name="Siglent SDS1000X-E",
    makers=("SIGLENT",),
    bits=8,
    bytes_per_sample=1,
    points_per_read=500_000,
    begin=("CHDR OFF",),
    trigger_channel=("TRSE EDGE,SR,C{n},HT,OFF",),
    trigger_external=("TRSE EDGE,SR,EX,HT,OFF",),
    slope={"rising": "{source}:TRSL POS", "falling": "{source}:TRSL NEG"},
    level="{source}:TRLV {volts:g}V",
    single=("TRMD SINGLE", "ARM"),
    status="SAST?",
    is_done=lambda answer: answer.upper() == "STOP",
    stop="STOP",
    depths=(7_000, 70_000, 700_000, 7_000_000),
    set_depth="MSIZ {short}",
    divisions=14,
    set_time_per_division="TDIV {seconds:.9g}S",
    set_trigger_delay="TRDL {seconds:.9g}S",
    max_samples=7_000_000,
    set_now=_siglent_timing,
    timing=_siglent_timing,
    select=(),
    scaling=_siglent_scaling,
    fetch=("WFSU SP,1,NP,{count},FP,{skip}", "C{n}:WF? DAT2"),
    decode=_from_signed,
)

KEYSIGHT = Dialect(
    name="Keysight InfiniiVision",
    makers=("KEYSIGHT", "AGILENT"),
    bits=16,
    bytes_per_sample=2,
    points_per_read=None,
    begin=(":WAV:FORM WORD", ":WAV:BYT LSBF", ":WAV:UNS OFF", ":WAV:POIN:MODE RAW", ":WAV:POIN MAX"),
    trigger_channel=(":TRIG:MODE EDGE", ":TRIG:EDGE:SOUR CHAN{n}"),
    trigger_external=(":TRIG:MODE EDGE", ":TRIG:EDGE:SOUR EXT"),
    slope={"rising": ":TRIG:EDGE:SLOP POS", "falling": ":TRIG:EDGE:SLOP NEG"},
    level=":TRIG:EDGE:LEV {volts:g}",
    single=(":SING",),
    status=":OPER:COND?",
    is_done=lambda answer: not int(numbers(answer, 1, "the operation condition")[0]) & 8,
    stop=":STOP",
    depths=(),
    set_depth="",
    divisions=10,
    set_time_per_division=":TIM:SCAL {seconds:.9g}",
    set_trigger_delay=":TIM:POS {seconds:.9g}",
    max_samples=8_000_000,
    set_now=_keysight_set_now,
    timing=_preamble_timing,
    select=(":WAV:SOUR CHAN{n}", ":WAV:POIN MAX"),
    scaling=_keysight_scaling,
    fetch=(":WAV:DATA?",),
    decode=_from_words,
)

DIALECTS = (SIGLENT, RIGOL, KEYSIGHT)


def dialect_of(identity: str) -> Dialect:
    """Return the dialect for an answer to ``*IDN?``.  Raises DigitizerError for an unknown instrument."""
    maker = identity.strip().upper()
    for dialect in DIALECTS:
        if maker.startswith(dialect.makers):
            return dialect
    known = ", ".join(dialect.name for dialect in DIALECTS)
    raise DigitizerError(f"no dialect for the instrument {shown(identity)}", f"known are {known}")


def one_two_five(value: float) -> float:
    """Return the smallest 1, 2 or 5 times a power of ten that is at least ``value``: a step of a time base."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1, 2, 5, 10) if m * power >= value * (1 - 1e-9))


def short_depth(samples: int) -> str:
    """Return a memory depth as Siglent writes it: 7K, 70K, 700K, 7M."""
    return f"{samples // 1_000_000}M" if samples >= 1_000_000 else f"{samples // 1000}K"
