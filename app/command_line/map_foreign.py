"""``levimass map``: list the channels of a foreign file, or save the roles of its channels."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.collision import PAPER
from analysis.shot import Role, Setup
from app.command_line.options import USAGE
from app.command_line.outputs import say
from instrument.files import (
    FOLDER_MAPPING,
    LENGTHS_M,
    WITHOUT_FORCE,
    ForeignContents,
    ForeignMapping,
    MappedChannel,
    MotionColumns,
    RecordingError,
    find_mapping,
    foreign_channels,
    length_unit,
    mapping_path,
    read_foreign,
    read_mapping,
    read_motion,
    save_columns,
    write_mapping,
)
from levimass import BASE_MODELS, DRIVE, ONE_BODY, PAPER_MODEL


@dataclass(frozen=True, slots=True)
class MapOptions:
    """Command-line options on the rig and the record; None if not given."""

    mass_kg: float | None = None
    rate_hz: float | None = None
    rest_hz: float | None = None
    wavelength_m: float | None = None
    bits: int | None = None
    unit: str | None = None  # unit of a displacement
    model: str | None = None  # base model of a displacement


class WrongOption(Exception):
    """The options do not form a valid mapping; the message says why in one line."""


DISPLACEMENT = "displacement"
_MODELS = {model.name: model.in_record for model in WITHOUT_FORCE}


def map_foreign(
    path: Path,
    channels: Sequence[str] | None,
    volts: Sequence[str] | None,
    given: MapOptions,
    *,
    for_folder: bool,
) -> int:
    """List a file's channels; with ``channels`` ("measurement=NAME") test and write its mapping.

    Returns the exit status: 1 if the file cannot be read with this mapping, 2 if an option is wrong.
    """
    try:
        if any(item.startswith(f"{DISPLACEMENT}=") for item in channels or ()):
            _map_displacement(path, channels or (), bool(volts) or for_folder, given)
        elif given.unit is not None or given.model is not None:
            raise WrongOption("--unit and --model go with --channel displacement=NAME")
        elif channels is not None:
            _map_beats(path, channels, volts, given, for_folder)
        elif volts or for_folder or replace(given, rate_hz=None) != MapOptions():
            raise WrongOption("assign the channels with --channel measurement=NAME")
        else:
            print(_listing(foreign_channels(path)))
    except WrongOption as error:
        say(f"--map: {error}")
        return USAGE
    except RecordingError as error:
        say(error)
        return 1
    return 0


def _map_beats(
    path: Path, channels: Sequence[str], volts: Sequence[str] | None, given: MapOptions, for_folder: bool
) -> None:
    """Save the mapping of beats and light switch, after the file has been read with it."""
    roles = _pairs(channels)
    factors = {role: _number(role, text) for role, text in _pairs(volts).items()}
    if Role.MEASUREMENT not in roles or given.mass_kg is None:
        raise WrongOption("a mapping needs at least --channel measurement=NAME and --mass KG")
    if given.bits is not None and given.bits > 16:
        raise WrongOption(f"--bits {given.bits}: not from 1 to 16")
    if unmapped := sorted(set(factors) - set(roles)):
        raise WrongOption(f"--volts {unmapped[0]}: no --channel has this role")
    mapping = ForeignMapping(
        foreign_channels(path).format,
        tuple(MappedChannel(role, name, factors.get(role)) for role, name in roles.items()),
        Setup(
            given.mass_kg,
            wavelength_air_m=given.wavelength_m,
            rest_frequency_hz=given.rest_hz,
            digitizer_bits=given.bits or 16,
        ),
        given.rate_hz,
    )
    shot = read_foreign(path, mapping)  # raises before an invalid mapping is saved
    mapping_file = path.with_name(FOLDER_MAPPING) if for_folder else mapping_path(path)
    write_mapping(mapping, mapping_file)
    trigger = "" if shot.trigger_sample is None else f", light switch at sample {shot.trigger_sample}"
    print(f"{path}: {shot.samples} samples at {shot.sample_rate_hz:g} samples/s{trigger}")
    print(f"mapping saved in {mapping_file}")


def _map_displacement(path: Path, channels: Sequence[str], of_beats: bool, given: MapOptions) -> None:
    """Save the column of a table that holds the displacement, and its unit."""
    own = replace(given, mass_kg=None, rate_hz=None, unit=None, model=None)
    if len(channels) > 1 or of_beats or own != MapOptions():
        raise WrongOption("a displacement goes with --unit, --model, --mass and --rate alone")
    if given.model is not None and given.model not in _MODELS:
        raise WrongOption(f"--model: a displacement without a force has {' or '.join(_MODELS)}")
    if given.unit is not None and given.unit not in LENGTHS_M:
        raise WrongOption(f"--unit {given.unit}: none of {', '.join(LENGTHS_M)}")
    channel = foreign_channels(path).channel(channels[0].partition("=")[2])
    unit = given.unit or length_unit(channel)
    if unit is None:
        raise WrongOption("the header states no unit of the displacement: --unit mm")
    model = _MODELS[given.model or ONE_BODY]
    mapping_file = save_columns(path, MotionColumns(channel.name, unit, model, given.mass_kg, given.rate_hz))
    record = read_motion(path)
    assert record.displacement_m is not None
    span = float(np.ptp(record.displacement_m))
    print(f"{path}: {record.time_s.size} rows, displacement in {unit} over {span:.6g} m")
    print(f"mapping saved in {mapping_file}")


def _pairs(given: Sequence[str] | None) -> dict[Role, str]:
    pairs: dict[Role, str] = {}
    for item in given or ():
        role, equals, value = item.partition("=")
        if role not in tuple(Role) or not equals or not value:
            raise WrongOption(f"{item!r} is not ROLE=..., ROLE being one of {', '.join(Role)}")
        if role in pairs:
            raise WrongOption(f"{role} is given twice")
        pairs[Role(role)] = value
    return pairs


def _number(role: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-30 < abs(value) < 1e9:
        raise WrongOption(f"--volts {role}={text}: not a number of volts")
    return value


def _listing(contents: ForeignContents) -> str:
    lines = [f"{contents.path} ({contents.format})"]
    for channel in contents.channels:
        rate = f"{channel.sample_rate_hz:.9g} samples/s" if channel.sample_rate_hz else "rate not stated"
        unit = f", {channel.unit}" if channel.unit else ""
        lines.append(f"  {channel.name!r}: {channel.samples} samples, {channel.kind}{unit}, {rate}")
    mapping_file = find_mapping(contents.path)
    if mapping_file is not None:
        lines.append(f"its mapping is in {mapping_file}:")
        try:
            mapping = read_mapping(mapping_file)
        except RecordingError as error:
            lines.append(f"  {error}")
        else:
            lines += [f"  {channel.role}: {channel.name!r}" for channel in mapping.channels]
    else:
        name = shlex.quote(contents.channels[0].name)
        more = "" if contents.channels[0].sample_rate_hz else " --rate HZ"
        lines.append("no mapping is saved; assign the channels, for example")
        path, mass = shlex.quote(str(contents.path)), PAPER.block_mass_kg
        lines.append(f"  levimass map {path} --channel measurement={name} --mass {mass} --rest 2.73e6{more}")
        lines += _positions(contents)
    return "\n".join(lines)


def _positions(contents: ForeignContents) -> list[str]:
    """Return lines of advice for a table that may hold positions instead of beats."""
    if contents.format != "csv":
        return []
    table = Path(contents.path)
    channel = next((c for c in contents.channels if length_unit(c)), contents.channels[0])
    name, unit = shlex.quote(channel.name), "" if length_unit(channel) else " --unit mm"
    one_body, paper, drive = (BASE_MODELS[base].in_record for base in (ONE_BODY, PAPER_MODEL, DRIVE))
    return [
        "are these positions, not beats? Then name the displacement column (and its unit: m, mm, um or nm)",
        f"  levimass map {shlex.quote(str(table))} --channel displacement={name}{unit} --mass 0.1",
        "or make it a motion record: name its columns time_s and displacement_m (or",
        f"velocity_m_per_s, force_n), and write {table.with_suffix('.toml').name} beside it, for example",
        f'  model = "{one_body}"        # or "{paper}" (two bodies), "{drive}" (a slider under the measured force_n)',
        "  moving_mass_kg = 0.1",
    ]
