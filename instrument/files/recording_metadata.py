"""Read and write the SigMF metadata of a recording; unknown keys of other programs are preserved."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from analysis.shot import Air, Channel, Gap, Plate, Role, Setup
from instrument.files.recording_error import shown
from instrument.files.text_file import CheckedTable, read_json

SIGMF_VERSION = "1.2.5"
_EXTENSION = {"name": "lmm", "version": "1.0.0", "optional": True}
RATES_HZ = 1e-3, 1e12  # accepted range: wider than any rig's, and safe in every formula
MASSES_KG = 1e-9, 1e6
_MAX_CHANNELS = 64
_MAX_SAMPLES = 2**53
_LONGEST_NOTE = 1_000_000
_PLATE = ("arm_length_m", "arm_width_m", "thickness_m", "disc_diameter_m", "density_kg_m3", "youngs_modulus_pa")


@dataclass(frozen=True, slots=True)
class Metadata:
    """The checked content of a .sigmf-meta.  ``extra`` holds unknown keys, sorted by "global", "captures", ...

    ``declared_samples`` is the stated number of samples per channel; ``at_least_samples`` is implied by indices.
    """

    sample_rate_hz: float
    channels: tuple[Channel, ...]
    setup: Setup
    trigger_sample: int | None
    gaps: tuple[Gap, ...]
    note: str
    started_at: str | None
    sha512: str | None
    declared_samples: int | None
    at_least_samples: int
    extra: Mapping[str, Any]


def read_metadata(path: Path) -> Metadata:
    """Read and check a .sigmf-meta file.  Raises RecordingError."""
    whole = CheckedTable(path, read_json(path))
    head = whole.required_object("global")
    datatype = head.text("core:datatype")
    if datatype != "ri16_le":
        raise head.error_for("core:datatype", "missing" if datatype is None else f"{shown(datatype)} is not 'ri16_le'")
    head.text("core:version")
    head.get("core:extensions")
    rate = head.required("core:sample_rate", *RATES_HZ)
    channels, channel_extra = _channels(head)
    setup = setup_of(head.required_object("lmm:setup"))
    for key in ("core:trailing_bytes", "core:metadata_only"):
        if head.values.get(key):
            raise head.error_for(key, "only recordings whose data file holds nothing but samples can be read")
    dataset = head.text("core:dataset")
    if dataset is not None and dataset != f"{path.name.removesuffix('.sigmf-meta')}.sigmf-data":
        raise head.error_for("core:dataset", "names another file; samples are read only from the file of the same name")
    trigger = head.whole("lmm:trigger_sample", 0, _MAX_SAMPLES)
    declared = head.whole("lmm:samples", 0, _MAX_SAMPLES)
    sha512 = head.text("core:sha512")
    started_at, capture_extra = _captures(whole)
    gaps, note, annotation_extra, ends, note_samples = _annotations(whole)
    if declared is None:
        declared = note_samples
    if trigger is not None:
        ends.append(trigger + 1)
    extensions = head.values.get("core:extensions")
    extra: dict[str, Any] = {
        "global": head.unread(),
        "captures": capture_extra,
        "annotations": annotation_extra,
        "channels": channel_extra,
        "extensions": extensions if isinstance(extensions, list) else [],
        "top": whole.unread(),
    }
    extra = {key: value for key, value in extra.items() if value}
    at_least = max(ends, default=0)
    return Metadata(rate, channels, setup, trigger, gaps, note, started_at, sha512, declared, at_least, extra)


def _channels(head: CheckedTable) -> tuple[tuple[Channel, ...], list[dict[str, Any]]]:
    listed = head.objects("lmm:channels")
    if not listed:
        raise head.error_for("lmm:channels", "missing" if listed is None else "empty")
    if len(listed) > _MAX_CHANNELS:
        raise head.error_for("lmm:channels", f"more than {_MAX_CHANNELS} channels")
    count = head.whole("core:num_channels", 1, _MAX_CHANNELS)
    if count is not None and count != len(listed):
        raise head.error_for("core:num_channels", f"{count}, but lmm:channels lists {len(listed)}")
    channels: dict[Role, Channel] = {}
    for item in listed:
        channel = _channel(item, channels)
        channels[channel.role] = channel
    if Role.MEASUREMENT not in channels:
        raise head.error_for("lmm:channels", "no channel has the role 'measurement'")
    foreign = [item.unread() for item in listed]
    return tuple(channels.values()), foreign if any(foreign) else []


def _channel(item: CheckedTable, before: Collection[Role]) -> Channel:
    """Return one channel, whose role must be none of those ``before``.  Raises RecordingError."""
    name = item.text("role")
    if name not in tuple(Role):
        raise item.error_for("role", "missing" if name is None else f"{shown(name)} is none of {', '.join(Role)}")
    role = Role(name)
    if role in before:
        raise item.error_for("role", f"a second {role} channel")
    scale = item.required("volts_per_count", -1e6, 1e6)
    if abs(scale) < 1e-30:
        raise item.error_for("volts_per_count", "zero")
    return Channel(role, scale, item.number("offset_v", -1e9, 1e9) or 0.0)


def setup_of(item: CheckedTable) -> Setup:
    """Return the set-up from an object with the keys of ``lmm:setup``.  Raises RecordingError."""
    extra: dict[str, Any] = {}
    air = None
    if (inside := item.object("air")) is not None:
        air = Air(
            inside.required("temperature_c", -90.0, 150.0),
            inside.required("pressure_pa", 1.0, 1e7),
            inside.required("humidity_percent", 0.0, 100.0),
        )
        extra["air"] = inside.unread()
    plate = None
    if (inside := item.object("plate")) is not None:
        plate = Plate(*(inside.required(key, 1e-12, 1e15) for key in _PLATE))
        extra["plate"] = inside.unread()
    setup = Setup(
        moving_mass_kg=item.required("moving_mass_kg", *MASSES_KG),
        moving_mass_u_kg=item.number("moving_mass_u_kg", 0.0, 1e6) or 0.0,
        wavelength_vacuum_m=item.number("wavelength_vacuum_m", 1e-9, 1e-3),
        wavelength_air_m=item.number("wavelength_air_m", 1e-9, 1e-3),
        air=air,
        rest_frequency_hz=item.number("rest_frequency_hz", *RATES_HZ),
        plate=plate,
        digitizer_bits=item.whole("digitizer_bits", 1, 16) or 16,
        rest_frequency_u_hz=item.number("rest_frequency_u_hz", 0.0, RATES_HZ[1]),
    )
    extra = {key: value for key, value in extra.items() if value} | item.unread()
    return replace(setup, extra=extra)


def _captures(whole: CheckedTable) -> tuple[str | None, list[dict[str, Any]]]:
    segments = whole.objects("captures") or []
    if not segments:
        return None, []
    first = segments[0]
    first.whole("core:sample_start", 0, _MAX_SAMPLES)
    started_at = first.text("core:datetime")
    if first.number("core:header_bytes", 0, _MAX_SAMPLES):
        raise first.error_for("core:header_bytes", "only data files that hold nothing but samples can be read")
    foreign = [first.unread(), *(dict(segment.values) for segment in segments[1:])]
    return started_at, foreign if any(foreign) else []


def _annotations(whole: CheckedTable) -> tuple[tuple[Gap, ...], str, list[dict[str, Any]], list[int], int | None]:
    """Return gaps, note, unknown annotations, the first sample after each, and the number of samples of the note."""
    gaps: list[Gap] = []
    notes: list[str] = []
    foreign: list[dict[str, Any]] = []
    ends: list[int] = []
    note_samples: int | None = None
    for item in whole.objects("annotations") or []:
        label = item.get("core:label")
        start = item.whole("core:sample_start", 0, _MAX_SAMPLES)
        count = item.whole("core:sample_count", 0, _MAX_SAMPLES)
        ends.append((start or 0) + (count or 0))
        if label == "gap":
            if start is None:
                raise item.error_for("core:sample_start", "missing on a gap")
            gaps.append(Gap(start, item.whole("lmm:samples_lost", 0, _MAX_SAMPLES)))
        elif label == "note":
            if comment := item.text("core:comment", _LONGEST_NOTE):
                notes.append(comment)
            if start == 0 and count:  # a note annotates the whole shot, so its count is the shot's
                note_samples = max(note_samples or count, count)
        else:
            foreign.append(dict(item.values))
    gaps.sort(key=lambda gap: gap.sample_start)
    return tuple(gaps), "\n".join(notes), foreign, ends, note_samples


def metadata_json(metadata: Metadata) -> dict[str, Any]:
    """Return the JSON object of a .sigmf-meta, with unknown keys restored; this program's keys take precedence."""
    extra = metadata.extra
    foreign_channels = list(extra.get("channels", ())) + [{}] * len(metadata.channels)
    extensions = [e for e in extra.get("extensions", ()) if not (isinstance(e, dict) and e.get("name") == "lmm")]
    head: dict[str, Any] = {
        **extra.get("global", {}),
        "core:datatype": "ri16_le",
        "core:num_channels": len(metadata.channels),
        "core:sample_rate": metadata.sample_rate_hz,
        "core:version": SIGMF_VERSION,
        "core:extensions": [*extensions, _EXTENSION],
        "lmm:channels": [
            {**other, "role": str(c.role), "volts_per_count": c.volts_per_count, "offset_v": c.offset_v}
            for c, other in zip(metadata.channels, foreign_channels, strict=False)
        ],
        "lmm:setup": setup_json(metadata.setup),
    }
    optional = {
        "core:sha512": metadata.sha512,
        "lmm:trigger_sample": metadata.trigger_sample,
        "lmm:samples": metadata.declared_samples,
    }
    head |= {key: value for key, value in optional.items() if value is not None}
    segments = [dict(segment) for segment in extra.get("captures", ())] or [{}]
    segments[0]["core:sample_start"] = 0
    if metadata.started_at is not None:
        segments[0]["core:datetime"] = metadata.started_at
    return {**extra.get("top", {}), "global": head, "captures": segments, "annotations": _annotations_json(metadata)}


def _annotations_json(metadata: Metadata) -> list[dict[str, Any]]:
    """Return the unknown annotations, the gaps and the note, in the order that SigMF requires."""
    annotations = [dict(item) for item in metadata.extra.get("annotations", ())]
    for gap in metadata.gaps:
        item: dict[str, Any] = {"core:sample_start": gap.sample_start, "core:label": "gap"}
        if gap.samples_lost is not None:
            item["lmm:samples_lost"] = gap.samples_lost
        annotations.append(item)
    if metadata.note:
        item = {"core:sample_start": 0, "core:label": "note", "core:comment": metadata.note}
        if metadata.declared_samples:
            item["core:sample_count"] = metadata.declared_samples
        annotations.append(item)
    return sorted(annotations, key=lambda a: a.get("core:sample_start") or 0)


def setup_json(setup: Setup) -> dict[str, Any]:
    """Return the object that ``setup_of`` reads."""
    written: dict[str, Any] = {k: v for k, v in setup.extra.items() if k not in ("air", "plate")}
    for name in Setup.__dataclass_fields__:
        value = getattr(setup, name)
        if name == "extra" or value is None:
            continue
        if name in ("air", "plate"):
            written[name] = {**setup.extra.get(name, {}), **asdict(value)}
        else:
            written[name] = value
    return written
