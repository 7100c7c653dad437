"""The Hantek 6022's calibration EEPROM: how codes become volts.

V = (code - 128 - offset) * 5.12 / (128 gain) * correction, with the integer offsets of bytes 8-23 (0x80 = 0), the gain
corrections 1 + (b - 128) / 500 of bytes 40-55 and the fractional offsets (b - 128) / 250 of bytes 56-71; eight ranges
of two channels each, and 0x00 or 0xFF where a corrections byte was never written (OpenHantek6022's EEPROM layout).
"""

from dataclasses import dataclass

FULL_SCALE_V = 5.12  # at gain 1, from the middle code to the rail
GAINS = {10: 0.5, 5: 1.0, 2: 2.5, 1: 5.0}  # gain step: nominal range, +- V
EEPROM_START = 8
EEPROM_BYTES = 80

_RANGE_INDEX = {10: 0, 5: 3, 2: 4, 1: 7}  # which of the eight ranges the calibration programs write for a gain
_OFFSET, _GAIN, _FINE = 0, 32, 48  # from EEPROM_START
_UNSET = (0x00, 0xFF)


@dataclass(frozen=True, slots=True)
class Scale:
    """Volts of a count, where a count is the code less 128."""

    volts_per_count: float
    offset_v: float


def scale_of(gain: int, channel: int, eeprom: bytes = b"") -> Scale:
    """Return the scale of ``channel`` (0 or 1) at a gain step; ``eeprom`` is what was read from byte 8 on."""
    at = 2 * _RANGE_INDEX[gain] + channel
    offset = _byte(eeprom, _OFFSET + at, 0) + _byte(eeprom, _FINE + at, 0) / 250
    volts = FULL_SCALE_V / (128 * gain) * (1 + _byte(eeprom, _GAIN + at, 0) / 500)
    return Scale(volts, -offset * volts)


def _byte(eeprom: bytes, at: int, otherwise: int) -> int:
    if at >= len(eeprom) or eeprom[at] in _UNSET:
        return otherwise
    return eeprom[at] - 128
