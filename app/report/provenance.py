"""Report sections for reproducing the numbers: how a shot was taken and analysed, data hash, command to repeat it."""

import math
import platform
from collections.abc import Collection, Mapping
from dataclasses import asdict, fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from analysis.collision import Effect
from analysis.diagnosis import saved, to_text
from analysis.shot import DEFAULT_WAVELENGTH_AIR_M, BeatQuality, NotSeen, Setup, Shot, program_version
from app.words import Markup, joined, table, tag
from instrument.files import (
    RecordingError,
    data_hash,
    find_mapping,
    is_foreign,
    one_line,
    read_mapping,
    read_metadata,
    recording_stem,
    shown,
)

NUMERICS = ("numpy", "scipy", "numba")


def taken_with(shot: Shot) -> Markup:
    """Return the table of digitizer, channels and rig of a shot."""
    rows = [["started", shot.started_at or "not stated"]]
    if shot.sample_rate_hz is not None:
        rows.append(["sample rate", f"{shot.sample_rate_hz:.10g} samples/s"])
    if shot.samples is not None:
        rows.append(["samples per channel", str(shot.samples)])
    if shot.trigger_time_s is not None:
        rows.append(["light switch", f"{1e3 * shot.trigger_time_s:.6g} ms after the first sample"])
    rows += _channels(shot)
    rows += _rig(shot.setup, shot)
    return table([], rows, "settings")


def analysed_with(shot: Shot) -> Markup:
    """Return the table of the analysis settings and the quality of the signals."""
    chosen = {entry.name: getattr(shot.settings, entry.name) for entry in fields(shot.settings)}
    rows = [[name.replace("_", " "), _value(value)] for name, value in chosen.items()]
    motion = shot.motion
    if motion is not None:
        wavelength = motion.wavelength_m
        rows.append(["wavelength in air", f"{1e9 * wavelength:.6f} nm" if wavelength else "none: no optics"])
        rows.append(["motion", f"{motion.time_s.size} samples at {motion.sample_rate_hz:g} Hz"])
        rows.append(["displacement known up to", f"{motion.displacement_band_hz:g} Hz"])
        rest = motion.rest_frequency_hz
        said = f"not measured: {rest.reason}" if isinstance(rest, NotSeen) else f"{rest.scaled(1e-6)} MHz"
        rows.append(["rest frequency", said])
        for words, beat in (("reference", motion.reference), ("measurement", motion.measurement)):
            if beat is not None:
                rows.append([f"{words} beat", _beat(beat)])
    spent = ", ".join(f"{what} {1e3 * seconds:.0f} ms" for what, seconds in shot.seconds.items())
    rows.append(["time spent", spent or "not measured"])
    return table([], rows, "settings")


def repeated_by(shot: Shot, tried: Collection[Effect] = ()) -> Markup:
    """Return the table of program versions, data hash and the command that repeats the report."""
    rows = [["program", program_words()]]
    if shot.path is None:
        rows.append(["data", "not on disk when this report was made"])
    else:
        rows.append(["file", shot.path])
        rows += _hash(shot.path)
        model = "model.toml" if shot.settings.effects else shot.settings.model
        command = f"levimass replay '{Path(shot.path).name}' --model {model} --report report.html"
        rows.append(["command", tag("code", command)])
        if shot.settings.effects and shot.fit is not None:
            text = to_text(saved(shot.fit, [shot.path], tried=tried))
            rows.append(["model.toml", tag("pre", text)])
        if shot.settings.corrections:
            rows.append(["corrected", "in the window, after the shot was taken; the recording has other values"])
    return table([], rows, "settings")


def program_words() -> str:
    """Return the versions of the program, Python and the packages on which the numbers depend."""
    parts = [f"levimass {program_version()}"]
    for name in NUMERICS:
        try:
            parts.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return f"{', '.join(parts)}, Python {platform.python_version()} on {platform.system()} {platform.machine()}"


def _hash(path: str) -> list[list[str]]:
    try:
        data = data_hash(path)
    except RecordingError as error:
        return [["data hash", f"not known: {error}"]]
    if data.agrees is None:
        said = "no hash was written when the data were taken"
    elif data.agrees:
        said = "as written when the shot was taken"
    else:
        said = f"NOT the one written when the shot was taken, {data.recorded}"
    return [
        ["data", f"{data.file}, {data.size_bytes} bytes"],
        ["data hash (SHA-512)", joined(tag("code", data.sha512), tag("br"), said)],
    ]


def _channels(shot: Shot) -> list[list[str]]:
    """Return rows on the channels, read from the recording's metadata because an analysed shot does not store them."""
    if shot.path and is_foreign(shot.path):
        return _mapped(Path(shot.path))
    stem = recording_stem(shot.path) if shot.path else None
    meta = stem.with_name(stem.name + ".sigmf-meta") if stem is not None else None
    if meta is None or not meta.exists():
        return []
    try:
        channels = read_metadata(meta).channels
    except RecordingError as error:
        return [["channels", f"no longer available: {error}"]]
    return [
        [f"channel {number}, {c.role}", f"{c.volts_per_count:.10g} V per count, offset {c.offset_v:g} V"]
        for number, c in enumerate(channels, 1)
    ]


def _mapped(path: Path) -> list[list[str]]:
    if (kept := find_mapping(path)) is None:
        return []
    try:
        mapping = read_mapping(kept)
    except RecordingError as error:
        return [["channels", f"no longer available: {error}"]]
    rows = [["read by", f"{kept.name} ({mapping.format})"]]
    for channel in mapping.channels:
        volts = "" if channel.volts_per_unit is None else f", {channel.volts_per_unit:.10g} V per unit"
        rows.append([str(channel.role), f"channel {channel.name}{volts}"])
    return rows


def _rig(setup: Setup | None, shot: Shot) -> list[list[str]]:
    if setup is None:
        mass = shot.motion.moving_mass_kg if shot.motion is not None else None
        return [["moving mass", f"{1e3 * mass:.8g} g"]] if mass is not None and math.isfinite(mass) else []
    rows = [["moving mass", f"{1e3 * setup.moving_mass_kg:.8g} g, u = {1e3 * setup.moving_mass_u_kg:.3g} g"]]
    if setup.wavelength_vacuum_m is not None:
        rows.append(["wavelength in vacuum", f"{1e9 * setup.wavelength_vacuum_m:.6f} nm"])
    if setup.wavelength_air_m is not None:
        rows.append(["wavelength in air, as given", f"{1e9 * setup.wavelength_air_m:.6f} nm"])
    if setup.wavelength_air_m is None and (setup.air is None or setup.wavelength_vacuum_m is None):
        rows.append(["wavelength in air", f"not given: {1e9 * DEFAULT_WAVELENGTH_AIR_M:.1f} nm assumed where needed"])
    if setup.air is not None:
        air = setup.air
        said = f"{air.temperature_c:g} °C, {air.pressure_pa:g} Pa, {air.humidity_percent:g} % humidity"
        rows.append(["air", said])
    if setup.rest_frequency_hz is not None:
        rows.append(["rest frequency, as given", f"{setup.rest_frequency_hz:.10g} Hz"])
    if setup.plate is not None:
        rows.append(["plate", ", ".join(f"{k.replace('_', ' ')} {v:g}" for k, v in asdict(setup.plate).items())])
    rows.append(["digitizer", f"{setup.digitizer_bits} bits"])
    rows += [[one_line(str(key), 60), _value(value)] for key, value in list(setup.extra.items())[:40]]
    return rows


def _beat(beat: BeatQuality) -> str:
    clipped = f", {100 * beat.clipped_fraction:.2g} % of the samples clipped" if beat.clipped_fraction else ""
    return f"{1e-6 * beat.frequency_hz:.6f} MHz, {beat.amplitude_v:.3g} V, {beat.snr_db:.1f} dB{clipped}"


def _item(item: Any) -> str:
    """Return one effect or one correction in words."""
    if isinstance(item, tuple):
        name, given = item
        return f"{str(name).replace('_', ' ')} {'removed' if given is None else format(given, '.8g')}"
    return str(getattr(item, "words", item))


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{one_line(str(k), 60)} {shown(v)}" for k, v in list(value.items())[:20])
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ", ".join(_item(item) for item in value) or "none"
    return f"{value:g}" if isinstance(value, float) else value if isinstance(value, str) else shown(value)
