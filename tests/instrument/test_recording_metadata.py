"""The metadata of a recording: written whole as stated, and every number accepted up to its limits and not beyond."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from analysis.shot.recording import Gap, Recording
from instrument.files.recording_error import RecordingError, RecordingExists, one_line, shown, system_message
from instrument.files.recording_metadata import metadata_json, read_metadata
from instrument.files.recording_writer import write_recording

Place = tuple[str | int, ...]
SETUP: Place = ("global", "lmm:setup")
CHANNEL: Place = ("global", "lmm:channels", 1)


@pytest.fixture
def written(shot: Recording, tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    """Return a metadata file and its content."""
    meta = write_recording(shot, tmp_path / "s")
    return meta, json.loads(meta.read_text())


def _put(meta: Path, whole: dict[str, Any], place: Place, value: object) -> None:
    inner: Any = whole
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    meta.write_text(json.dumps(whole))


def test_a_file_says_all_of_a_recording_under_the_names_of_the_format(written: tuple[Path, dict[str, Any]]) -> None:
    meta, whole = written
    assert len(whole["global"].pop("core:sha512")) == 128
    assert whole == {
        "global": {
            "core:author": "someone",
            "lmm:other": [1, {"a": None}],
            "core:datatype": "ri16_le",
            "core:num_channels": 3,
            "core:sample_rate": 30e6,
            "core:version": "1.2.5",
            "core:extensions": [{"name": "lmm", "version": "1.0.0", "optional": True}],
            "lmm:channels": [
                {"role": "reference", "volts_per_count": 5e-4, "offset_v": 0.0},
                {"role": "measurement", "volts_per_count": 4e-4, "offset_v": 0.01},
                {"role": "switch", "volts_per_count": 1e-3, "offset_v": 0.0},
            ],
            "lmm:setup": {
                "moving_mass_kg": 0.01785,
                "moving_mass_u_kg": 1e-6,
                "wavelength_vacuum_m": 632.991354e-9,
                "air": {"co2_ppm": 450, "temperature_c": 20.0, "pressure_pa": 101325.0, "humidity_percent": 50.0},
                "plate": {
                    "arm_length_m": 0.015,
                    "arm_width_m": 0.002,
                    "thickness_m": 0.0003,
                    "disc_diameter_m": 0.01,
                    "density_kg_m3": 8510.0,
                    "youngs_modulus_pa": 131e9,
                },
                "digitizer_bits": 12,
                "rig": "north bench",
            },
            "lmm:trigger_sample": 5_000,
            "lmm:samples": 20_000,
        },
        "captures": [{"core:sample_start": 0, "core:datetime": "2026-11-20T09:00:07Z"}],
        "annotations": [
            {
                "core:sample_start": 0,
                "core:label": "note",
                "core:comment": "first touch\nafter cleaning",
                "core:sample_count": 20_000,
            },
            {"core:sample_start": 12_000, "core:label": "gap", "lmm:samples_lost": 77},
            {"core:sample_start": 15_000, "core:label": "gap"},
        ],
    }
    again = metadata_json(read_metadata(meta))
    del again["global"]["core:sha512"]
    assert again == whole


@pytest.mark.parametrize(
    ("place", "low", "high"),
    [
        (("global", "core:sample_rate"), 1e-3, 1e12),
        (("global", "lmm:trigger_sample"), 0, 2**53),
        (("global", "lmm:samples"), 0, 2**53),
        ((*CHANNEL, "volts_per_count"), -1e6, 1e6),
        ((*CHANNEL, "offset_v"), -1e9, 1e9),
        ((*SETUP, "moving_mass_kg"), 1e-9, 1e6),
        ((*SETUP, "moving_mass_u_kg"), 0.0, 1e6),
        ((*SETUP, "wavelength_vacuum_m"), 1e-9, 1e-3),
        ((*SETUP, "wavelength_air_m"), 1e-9, 1e-3),
        ((*SETUP, "rest_frequency_hz"), 1e-3, 1e12),
        ((*SETUP, "rest_frequency_u_hz"), 0.0, 1e12),
        ((*SETUP, "digitizer_bits"), 1, 16),
        ((*SETUP, "air", "temperature_c"), -90.0, 150.0),
        ((*SETUP, "air", "pressure_pa"), 1.0, 1e7),
        ((*SETUP, "air", "humidity_percent"), 0.0, 100.0),
        *(((*SETUP, "plate", key), 1e-12, 1e15) for key in ("arm_length_m", "thickness_m", "youngs_modulus_pa")),
        (("captures", 0, "core:sample_start"), 0, 2**53),
        (("annotations", 1, "core:sample_start"), 0, 2**53),
        (("annotations", 1, "core:sample_count"), 0, 2**53),
        (("annotations", 1, "lmm:samples_lost"), 0, 2**53),
    ],
)
def test_a_number_is_read_up_to_its_limits_and_refused_by_name_beyond(
    place: Place, low: float, high: float, written: tuple[Path, dict[str, Any]]
) -> None:
    meta, whole = written
    for value in (low, high):
        _put(meta, whole, place, value)
        read_metadata(meta)
    whole_numbers = isinstance(low, int)
    below = low - 1 if whole_numbers else low * (0.999 if low > 0.0 else 1.001) if low else -1e-300
    above = high + 1 if whole_numbers else high * 1.001
    for value in (below, above, "1", True, [1]):
        _put(meta, whole, place, value)
        with pytest.raises(RecordingError, match=str(place[-1])):
            read_metadata(meta)


@pytest.mark.parametrize(
    ("place", "value", "line"),
    [
        ((*CHANNEL, "volts_per_count"), 0.9e-30, "lmm:channels[1].volts_per_count: zero"),
        (("global", "core:num_channels"), 2, "core:num_channels: 2, but lmm:channels lists 3"),
        ((*CHANNEL, "role"), "reference", "lmm:channels[1].role: a second reference channel"),
        ((*CHANNEL, "role"), None, "lmm:channels[1].role: missing"),
        ((*CHANNEL, "role"), "x" * 30, f"lmm:channels[1].role: '{'x' * 30}' is none of reference, measurement, switch"),
        (("global", "core:datatype"), "rf32_le", "core:datatype: 'rf32_le' is not 'ri16_le'"),
        (("global", "core:trailing_bytes"), 4, "core:trailing_bytes: only recordings whose data file holds nothing"),
        (("global", "core:metadata_only"), True, "core:metadata_only: only recordings whose data file holds nothing"),
        (("captures", 0, "core:header_bytes"), 1, "captures[0].core:header_bytes: only data files that hold nothing"),
        (("captures", 0, "core:sample_start"), "x", "captures[0].core:sample_start: 'x' is not a whole number"),
        (("global", "core:dataset"), "s.sigmf-meta", "core:dataset: names another file"),
        (("annotations", 1, "core:sample_start"), None, "annotations[1].core:sample_start: missing on a gap"),
        ((*SETUP, "moving_mass_kg"), None, "lmm:setup.moving_mass_kg: missing"),
        ((*SETUP, "air", "pressure_pa"), None, "lmm:setup.air.pressure_pa: missing"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(
    place: Place, value: object, line: str, written: tuple[Path, dict[str, Any]]
) -> None:
    meta, whole = written
    _put(meta, whole, place, value)
    with pytest.raises(RecordingError) as refusal:
        read_metadata(meta)
    found = str(refusal.value).removeprefix(f"{meta}: ").removeprefix("global.")
    assert found.startswith(line)


def test_what_says_nothing_is_no_fault_and_what_is_left_out_has_its_usual_value(
    written: tuple[Path, dict[str, Any]],
) -> None:
    meta, whole = written
    head = whole["global"]
    for key, nothing in (("core:trailing_bytes", 0), ("core:metadata_only", False), ("core:dataset", "s.sigmf-data")):
        head[key] = nothing
    whole["captures"][0]["core:header_bytes"] = 0
    del head["lmm:channels"][1]["offset_v"], head["core:num_channels"], head["lmm:samples"]
    for key in ("moving_mass_u_kg", "digitizer_bits", "air", "plate", "wavelength_vacuum_m"):
        del head["lmm:setup"][key]
    head["lmm:setup"]["moving_mass_kg"] = 1  # a whole number is a number
    head["lmm:trigger_sample"] = 5000.0
    whole["annotations"] = [
        {"core:label": "gap", "core:sample_start": 700},
        {"core:label": "gap", "core:sample_start": 30, "lmm:samples_lost": 2},
        {"core:label": "note", "core:sample_start": 0, "core:sample_count": 19, "core:comment": "one"},
        {"core:label": "note", "core:comment": ""},
        {"core:label": "note", "core:sample_start": 5, "core:sample_count": 44, "core:comment": "two"},
        {"core:label": "else", "core:sample_start": 6000, "core:sample_count": 10},
    ]
    meta.write_text(json.dumps(whole))
    found = read_metadata(meta)
    setup = found.setup
    assert (setup.moving_mass_kg, setup.moving_mass_u_kg, setup.digitizer_bits) == (1.0, 0.0, 16)
    assert (setup.air, setup.plate, setup.wavelength_vacuum_m) == (None, None, None)
    assert found.channels[1].offset_v == 0.0 and found.trigger_sample == 5000
    assert found.gaps == (Gap(30, 2), Gap(700, None)) and found.note == "one\ntwo"
    assert (found.declared_samples, found.at_least_samples) == (19, 6010)  # the extent of a note from the first sample
    whole["annotations"], head["lmm:trigger_sample"] = [], 7000
    meta.write_text(json.dumps(whole))
    assert (read_metadata(meta).declared_samples, read_metadata(meta).at_least_samples) == (None, 7001)
    del whole["annotations"], whole["captures"]
    meta.write_text(json.dumps(whole))
    bare = read_metadata(meta)
    assert (bare.gaps, bare.note, bare.started_at, bare.at_least_samples) == ((), "", None, 7001)
    del head["lmm:trigger_sample"]
    meta.write_text(json.dumps(whole))
    assert (read_metadata(meta).trigger_sample, read_metadata(meta).at_least_samples) == (None, 0)


def test_a_value_is_shown_in_one_short_line() -> None:
    assert one_line("a\nb\x00c\u2028", 200) == "a b c " and one_line("x" * 200) == "x" * 200
    assert one_line("x" * 201) == "x" * 197 + "..." and one_line("abcdef", 5) == "ab..."
    assert [shown(value) for value in ({}, [], None, True, 1.5, math.inf)] == [
        *("an object", "a list", "None", "True", "1.5", "inf")
    ]
    assert [shown(value) for value in (10**18, -(10**18))] == ["a huge whole number"] * 2
    assert shown(10**18 - 1) == "9" * 18 and shown("ab") == "'ab'"
    assert shown("x" * 58) == f"'{'x' * 58}'" and shown("x" * 5000) == "'" + "x" * 56 + "..."
    refused = (OSError(28, "No space left on device", "/a"), OSError("odd"))
    assert [system_message(error) for error in refused] == ["No space left on device", "odd"]
    assert str(RecordingExists(Path("a"))) == "a: exists already; a recording is never overwritten"
    assert str(RecordingError("a", "c", "k")) == "a: k: c" and RecordingError(Path("a"), "c", "k").path == "a"
    assert str(RecordingError("a", "c" * 700)) == "a: " + "c" * 594 + "..."
