"""``levimass --map``: what a foreign file holds, and the mapping that makes it a recording, remembered beside it."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.shot.recording import Role, Setup
from instrument.files.foreign.contents import ForeignContents
from instrument.files.foreign.mapping import (
    OF_FOLDER,
    ForeignMapping,
    MappedChannel,
    own_mapping,
    read_mapping,
    remembered_mapping,
    write_mapping,
)
from instrument.files.foreign.reading import foreign_channels, read_foreign
from instrument.files.recording_error import RecordingError


@dataclass(frozen=True, slots=True)
class Given:
    """What the call says of the rig and the record, None where it says nothing."""

    mass_kg: float | None = None
    rate_hz: float | None = None
    rest_hz: float | None = None
    wavelength_m: float | None = None
    bits: int | None = None


def map_foreign(
    path: Path,
    channels: Sequence[str] | None,
    volts: Sequence[str] | None,
    given: Given,
    *,
    for_folder: bool,
) -> int:
    """List a file's channels; with ``channels`` ("measurement=NAME") write its mapping and try it.

    Returns the exit status: 1 where the file cannot be read so, 2 where an option says nothing that can be understood.
    """
    try:
        roles, scales = _pairs(channels), _pairs(volts)
        factors = {role: _number(role, text) for role, text in scales.items()}
        if channels is not None and (Role.MEASUREMENT not in roles or given.mass_kg is None):
            raise ValueError("a mapping needs at least --channel measurement=NAME and --mass KG")
        if given.bits is not None and given.bits > 16:
            raise ValueError(f"--bits {given.bits}: not from 1 to 16")
        if channels is None and (factors or for_folder or replace(given, rate_hz=None) != Given()):
            raise ValueError("which channel is which? --channel measurement=NAME")
        if unmapped := sorted(set(factors) - set(roles)):
            raise ValueError(f"--volts {unmapped[0]}: no --channel has this role")
    except ValueError as error:
        print(f"levimass: --map: {error}", file=sys.stderr)
        return 2
    try:
        held = foreign_channels(path)
        if channels is None:
            print(_listing(held))
            return 0
        assert given.mass_kg is not None
        mapping = ForeignMapping(
            held.format,
            tuple(MappedChannel(role, name, factors.get(role)) for role, name in roles.items()),
            Setup(
                given.mass_kg,
                wavelength_air_m=given.wavelength_m,
                rest_frequency_hz=given.rest_hz,
                digitizer_bits=given.bits or 16,
            ),
            given.rate_hz,
        )
        shot = read_foreign(path, mapping)  # a mapping that does not work is not remembered
        kept = path.with_name(OF_FOLDER) if for_folder else own_mapping(path)
        write_mapping(mapping, kept)
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        return 1
    trigger = "" if shot.trigger_sample is None else f", light switch at sample {shot.trigger_sample}"
    print(f"{path}: {shot.samples} samples at {shot.sample_rate_hz:g} samples/s{trigger}")
    print(f"remembered in {kept}")
    return 0


def _pairs(given: Sequence[str] | None) -> dict[Role, str]:
    pairs: dict[Role, str] = {}
    for item in given or ():
        role, equals, value = item.partition("=")
        if role not in tuple(Role) or not equals or not value:
            raise ValueError(f"{item!r} is not ROLE=..., ROLE being one of {', '.join(Role)}")
        if role in pairs:
            raise ValueError(f"a second {role}")
        pairs[Role(role)] = value
    return pairs


def _number(role: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-30 < abs(value) < 1e9:
        raise ValueError(f"--volts {role}={text}: not a number of volts")
    return value


def _listing(held: ForeignContents) -> str:
    lines = [f"{held.path} ({held.format})"]
    for channel in held.channels:
        rate = f"{channel.sample_rate_hz:.9g} samples/s" if channel.sample_rate_hz else "rate not stated"
        unit = f", {channel.unit}" if channel.unit else ""
        lines.append(f"  {channel.name!r}: {channel.samples} samples, {channel.kind}{unit}, {rate}")
    kept = remembered_mapping(held.path)
    if kept is not None:
        lines.append(f"its mapping is in {kept}:")
        try:
            mapping = read_mapping(kept)
        except RecordingError as error:
            lines.append(f"  {error}")
        else:
            lines += [f"  {channel.role}: {channel.name!r}" for channel in mapping.channels]
    else:
        name = shlex.quote(held.channels[0].name)
        more = "" if held.channels[0].sample_rate_hz else " --rate HZ"
        lines.append("no mapping is remembered; say which channel is which, for example")
        path = shlex.quote(str(held.path))
        lines.append(f"  levimass --map {path} --channel measurement={name} --mass 0.01785 --rest 2.73e6{more}")
        lines += _positions(held)
    return "\n".join(lines)


def _positions(held: ForeignContents) -> list[str]:
    """Return the way in for someone whose table holds positions, not beats."""
    if held.format != "csv":
        return []
    table = Path(held.path)
    return [
        "are these positions, not beats? Then it is a motion record: name its columns time_s and displacement_m (or",
        f"velocity_m_per_s, force_n), and write {table.with_suffix('.toml').name} beside it, for example",
        '  model = "contact"        # or "plate" (two bodies), "driven" (a slider under the measured force_n)',
        "  moving_mass_kg = 0.1",
    ]
