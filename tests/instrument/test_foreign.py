"""Raw beats in files of other programs: their channels listed, read by a mapping, refused in one line."""

import re
import struct
import wave
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.shot.recording import Air, Plate, Recording, Role, Setup
from instrument.files import csv_table, foreign_file, foreign_reading, foreign_tdms
from instrument.files.foreign_file import (
    FOLDER_MAPPING,
    ForeignMapping,
    MappedChannel,
    find_mapping,
    is_foreign,
    mapping_path,
    read_mapping,
    write_mapping,
)
from instrument.files.foreign_reading import foreign_channels, foreign_columns, read_foreign, to_counts
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import open_recording
from instrument.files.recording_search import find_recordings, is_motion_record

RATE = 2e6
SETUP = Setup(0.01785, 1e-6, rest_frequency_hz=2.5e5)
HEAD = 'format = "wav"\n[channels.measurement]\nname = "a"\n'
Volts = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def volts() -> Volts:
    """Return reference, measurement and switch in V, 12 bits of 1 V, the switch stepping at sample 6000."""
    rng = np.random.default_rng(5)
    t = np.arange(20_000)
    lines = {
        "PD0": 0.7 * np.sin(0.8 * t) + 0.1,
        "PD1": 0.6 * np.sin(0.9 * t) + rng.normal(0, 2e-3, t.size),
        "gate": np.where(t < 6_000, 0.05, 0.9) + rng.normal(0, 2e-3, t.size),
    }
    return {name: np.round(line * 2048) / 2048 for name, line in lines.items()}


def write_tdms(path: Path, volts: Volts, counts: bool = False) -> dict[str, str]:
    nptdms = pytest.importorskip("nptdms")
    about = {"wf_increment": 1 / RATE, "wf_start_offset": 0.0, "wf_start_time": np.datetime64("2026-03-01T10:00:00")}
    scale = {
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 1 / 2048, "NI_Scale[0]_Linear_Y_Intercept": 0.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }  # fmt: skip
    lines = []
    for name, values in volts.items():
        stored = np.rint(values * 2048).astype(np.int16) if counts else values
        properties = {**about, "unit_string": "V", **(scale if counts else {})}
        lines.append(nptdms.ChannelObject("scope", name, stored, properties))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(lines)
    return {name: f"scope/{name}" for name in volts}


def write_hdf5(path: Path, volts: Volts) -> dict[str, str]:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.attrs["fs"] = RATE
        file["scope/PD0"] = volts["PD0"]
        file["scope/PD0"].attrs["unit"] = "V"
        table = np.stack([volts["PD1"], volts["gate"]], axis=1).astype(np.float32)
        file.create_dataset("scope/both", data=table, compression="gzip")
        file["remark"] = "not numbers"
    return {"PD0": "scope/PD0", "PD1": "scope/both[0]", "gate": "scope/both[1]"}


def write_wav(path: Path, volts: Volts) -> dict[str, str]:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(3)
        file.setsampwidth(2)
        file.setframerate(int(RATE))
        table = np.stack(list(volts.values()), axis=1)
        file.writeframes(np.rint(table * 32768).astype("<i2").tobytes())
    return {name: f"channel {n}" for n, name in enumerate(volts, 1)}


def write_csv(path: Path, volts: Volts) -> dict[str, str]:
    time = np.arange(volts["PD0"].size) / RATE
    rows = ["Model;Scope 5", "Record Length;20000", "", "Time;PD0;PD1;gate", "(us);(V);(V);(V)"]
    table = np.stack([1e6 * time, *volts.values()], axis=1)
    rows += [";".join(f"{v:.7g}".replace(".", ",") for v in row) for row in table]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return {name: name for name in volts}


WRITERS: dict[str, Callable[[Path, Volts], dict[str, str]]] = {
    "a.tdms": write_tdms,
    "b.tdms": lambda path, volts: write_tdms(path, volts, counts=True),
    "a.h5": write_hdf5,
    "a.wav": write_wav,
    "a.csv": write_csv,
}


def mapping_for(path: Path, names: dict[str, str]) -> ForeignMapping:
    channels = (
        MappedChannel(Role.MEASUREMENT, names["PD1"]),
        MappedChannel(Role.REFERENCE, names["PD0"]),
        MappedChannel(Role.SWITCH, names["gate"]),
    )
    return ForeignMapping(foreign_channels(path).format, channels, SETUP)


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_volts_that_went_in(name: str, volts: Volts, tmp_path: Path) -> None:
    path = tmp_path / name
    names = WRITERS[name](path, volts)
    held = foreign_channels(path)
    assert set(names.values()) <= {channel.name for channel in held.channels}
    assert all(c.samples == 20_000 and c.sample_rate_hz == pytest.approx(RATE) for c in held.channels)
    shot = read_foreign(path, mapping_for(path, names))
    assert shot.counts.dtype == np.int16 and not shot.counts.flags.writeable
    assert shot.sample_rate_hz == pytest.approx(RATE) and shot.setup == SETUP
    assert shot.name == path.stem
    for role, key in ((Role.REFERENCE, "PD0"), (Role.MEASUREMENT, "PD1"), (Role.SWITCH, "gate")):
        column = shot.column(role)
        assert column is not None
        channel = shot.channels[column]
        got = shot.counts[:, column] * channel.volts_per_count + channel.offset_v
        assert np.max(np.abs(got - volts[key])) < 3e-5, key  # 16 bits of 1 V
    assert shot.trigger_sample is not None and abs(shot.trigger_sample - 6_000) <= 1
    if name == "a.wav":  # what is not needed at once is not read into memory
        (column,) = foreign_columns(held, ["channel 2"])
        assert isinstance(column.values, np.memmap)
    if name == "b.tdms":
        assert np.array_equal(shot.counts[:, 0], np.rint(volts["PD1"] * 2048))
    if name.endswith("tdms"):
        assert shot.started_at == "2026-03-01T10:00:00.000000Z"


def test_a_mapping_reads_as_it_was_written(tmp_path: Path) -> None:
    rig = Setup(
        0.01785, 1e-6, wavelength_vacuum_m=632.991354e-9, air=Air(20.0, 101325.0, 50.0), rest_frequency_hz=None,
        plate=Plate(0.015, 0.002, 0.0003, 0.01, 8510.0, 131e9), digitizer_bits=12,
        extra={"rig \"north\"\n": ["a", 1, 2.5, True, {"deep": "x"}], "air": {"co2": 450}},
    )  # fmt: skip
    least, most = MappedChannel(Role.MEASUREMENT, "PD1", -1e9, -1e9), MappedChannel(Role.SWITCH, "PD1", 1e9, 1e9)
    channels = (MappedChannel(Role.REFERENCE, 'a "b"\\\n\x07é', 0.5, -1.0), MappedChannel(Role.MEASUREMENT, "PD1"))
    for chosen in (channels, (least, most)):
        mapping = ForeignMapping("tdms", chosen, rig, 30e6, 17 if chosen is channels else 0)
        write_mapping(mapping, tmp_path / "m.toml")
        assert read_mapping(tmp_path / "m.toml") == mapping


@pytest.mark.parametrize(
    ("changed", "scale"),
    [
        ({}, (0.25, -3.0)),
        ({"NI_Scale[0]_Linear_Slope": 1.1e-30}, (1.1e-30, -3.0)),
        ({"NI_Scale[0]_Linear_Slope": -1.1e-30}, (-1.1e-30, -3.0)),
        ({"NI_Scale[0]_Linear_Slope": 0.9e-30}, None),
        ({"NI_Scale[0]_Linear_Slope": np.inf}, None),
        ({"NI_Scale[0]_Linear_Y_Intercept": np.nan}, None),
        ({"NI_Scale[0]_Linear_Y_Intercept": "low"}, None),
        ({"NI_Scale[0]_Scale_Type": "Polynomial"}, None),
        ({"NI_Number_Of_Scales": 2}, None),
        ({"NI_Number_Of_Scales": None}, None),
    ],
)
def test_one_linear_scale_that_can_be_is_kept(changed: dict[str, object], scale: tuple[float, float] | None) -> None:
    usual: dict[str, object] = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear"}
    usual |= {"NI_Scale[0]_Linear_Slope": 0.25, "NI_Scale[0]_Linear_Y_Intercept": -3.0}
    assert foreign_tdms._linear_scale(usual | changed) == scale
    assert foreign_tdms._linear_scale({}) is None


@pytest.mark.parametrize(("step", "possible"), [(1.1e-12, True), (0.9e-12, False), (0.9e12, True), (1.1e12, False)])
def test_a_step_of_tdms_lies_between_a_picosecond_and_its_inverse(step: float, possible: bool) -> None:
    found = foreign_tdms._rate(SimpleNamespace(properties={"wf_increment": step}))
    assert found == (pytest.approx(1 / step) if possible else None)


@pytest.mark.parametrize(("error", "why"), [(ValueError("odd\nhead"), "odd head"), (EOFError(), "EOFError")])
def test_what_a_formats_library_raises_is_one_line(
    error: Exception, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks(path: Path) -> None:
        raise error

    (tmp_path / "a.wav").write_bytes(b"RIFF")
    monkeypatch.setitem(foreign_reading._CONTENTS, "wav", breaks)
    with pytest.raises(RecordingError) as refusal:
        foreign_channels(tmp_path / "a.wav")
    assert str(refusal.value) == f"{tmp_path / 'a.wav'}: cannot be read as wav ({why})"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "format"), ("= nonsense", "not TOML"), ('format = "wav"', "channels"), ("[[[", "not TOML"),
        ('format = "wav"\n[channels.reference]\nname = "a"\n', "measurement"),
        ('format = "wav"\n[channels.measurement]\nname = 3\n', "name"),
        ('format = "wav"\n[channels.measurement]\nname = "a"\n', "setup"),
        (f"{HEAD}volts_per_unit = 0.0\n[setup]\nmoving_mass_kg = 1.0", "zero"),
        (f"{HEAD}volts_per_unit = 1.01e9\n[setup]\nmoving_mass_kg = 1.0", r"10000000.0 is not from -1e\+09 to 1e\+09"),
        (f"{HEAD}volts_per_unit = -1.01e9\n[setup]\nmoving_mass_kg = 1.0", r"10000000.0 is not from -1e\+09 to 1e\+09"),
        (f"{HEAD}offset_v = 1.01e9\n[setup]\nmoving_mass_kg = 1.0", r"10000000.0 is not from -1e\+09 to 1e\+09"),
        (f"{HEAD}offset_v = -1.01e9\n[setup]\nmoving_mass_kg = 1.0", r"10000000.0 is not from -1e\+09 to 1e\+09"),
        (f"{HEAD}[setup]\nmoving_mass_kg = nan", "moving_mass_kg"),
        ('format = "wav"\n[channels.light]\nname = "a"\n[channels.measurement]\nname = "a"\n', "light"),
        (f"sample_rate_hz = -1\n{HEAD}[setup]\nmoving_mass_kg = 1", "sample_rate"),
        ("a = " + "[" * 100_000, "not TOML"),
    ],
)  # fmt: skip
def test_a_wrong_mapping_is_one_line_with_its_key(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(text)
    with pytest.raises(RecordingError, match=said) as refusal:
        read_mapping(path)
    assert "\n" not in str(refusal.value) and str(path) in str(refusal.value)


def test_a_remembered_mapping_makes_a_file_a_shot(volts: Volts, tmp_path: Path) -> None:
    first, second = tmp_path / "shot-2.wav", tmp_path / "shot-10.wav"
    names = write_wav(first, volts)
    write_wav(second, volts)
    (tmp_path / "notes.csv").write_text("a,b\n1,2\n3,4\n")
    assert find_recordings([tmp_path]) == [tmp_path]
    with pytest.raises(RecordingError, match=r"levimass map notes\.csv"):
        open_recording(tmp_path)
    advice = "'levimass map shot-2.wav' lists them and shows how to say it"
    line = f"{first}: nothing says which of its channels is which; {advice}"
    with pytest.raises(RecordingError, match=re.escape(line)):
        open_recording(first)
    with pytest.raises(RecordingError, match=re.escape(f"{tmp_path / 'shot-3.wav'}: no such file")):
        open_recording(tmp_path / "shot-3.wav")
    mapping = mapping_for(first, names)
    write_mapping(mapping, mapping_path(first))
    assert find_recordings([tmp_path]) == [first]
    assert find_recordings([mapping_path(first)]) == [first]
    write_mapping(replace(mapping, sample_rate_hz=1e6), tmp_path / FOLDER_MAPPING)
    assert find_recordings([tmp_path]) == [first, second]  # not the table: the folder's mapping is for WAV
    assert open_recording(first).sample_rate_hz == RATE and open_recording(second).sample_rate_hz == 1e6
    assert find_mapping(second) == tmp_path / FOLDER_MAPPING and not is_foreign(tmp_path / "notes.csv")


def test_a_motion_record_stays_one(tmp_path: Path) -> None:
    table = tmp_path / "m.csv"
    table.write_text("time_s,displacement_m\n0,0\n1,1\n")
    assert is_motion_record(table)
    (tmp_path / "m.toml").write_text('model = "plate"\n')
    mapping_path(table).write_text('format = "csv"\n')
    assert is_motion_record(table) and not is_foreign(table)
    (tmp_path / "m.toml").unlink()
    assert not is_motion_record(table) and is_foreign(table)


def test_counts_hold_the_volts_to_half_a_step_and_see_clipping() -> None:
    rng = np.random.default_rng(2)
    volts = 0.3 * np.sin(0.7 * np.arange(50_000)) + 5.0 + rng.normal(0, 1e-3, 50_000)
    counts, unit, offset = to_counts(volts)
    assert np.max(np.abs(counts * unit + offset - volts)) <= 0.5001 * unit
    assert np.abs(counts).max() < 32767
    coarse = np.round(60 * np.sin(0.7 * np.arange(50_000))) / 60  # eight bits in volts: piles up, yet is not clipped
    assert np.abs(to_counts(coarse)[0]).max() < 32767
    cut = np.clip(volts, 4.8, 5.2)
    assert np.mean(np.abs(to_counts(cut)[0]) == 32767) > 0.1
    for dtype, middle in ((np.uint8, 128), (np.uint16, 32768), (np.int8, 0), (np.int16, 0)):
        values = np.array([np.iinfo(dtype).min, np.iinfo(dtype).max], dtype)
        counts, unit, offset = to_counts(values)
        assert (unit, offset) == (1.0, middle) and np.array_equal(counts.astype(int) + middle, values.astype(int))
    for first in (1, 3):
        with pytest.raises(ValueError, match=f"^sample {first} is not a finite number$"):
            to_counts(np.where(np.arange(6) < first, 1.0, np.inf))
    assert to_counts(np.full(9, 3.5))[1:] == (1.0, 3.5) and np.all(to_counts(np.full(9, 3.5))[0] == 0)
    least = 2 * 32767 * np.finfo(np.float64).tiny  # of which a count is the smallest number there is
    assert to_counts(np.array([0.0, 0.9 * least]))[0].tolist() == [0, 0]
    assert to_counts(np.array([0.0, 1.1 * least]))[0].tolist() == [-32000, 32000]
    assert np.isfinite(to_counts(np.array([-1.7e308, 1.7e308]))[1])


def test_tables_of_many_kinds(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    for text, names, rate in (
        ("1\n2\n3\n", ["column 1"], None),
        ("1,2,\n3,4,\n5,6,\n", ["column 1", "column 2"], None),
        ('"TIME","CH1","CH1"\n0.0,1,2\n0.5,3,4\n1.0,5,6\n', ["CH1", "CH1 (2)"], 2.0),
        ("t [ms]\tvolts (V)\n0\t1\n1\t2\n2\t1\n", ["volts"], 1000.0),
        ("\ufeffx;y\r\n1,5;2,5\r\n2,5;3,5\r\n", ["x", "y"], None),
        ("a;b\n0;0\n0,5;1\n1;1,5\n", ["a", "b"], None),
    ):
        path.write_text(text, encoding="utf-8")
        held = foreign_channels(path)
        assert [c.name for c in held.channels] == names, text
        assert held.channels[0].sample_rate_hz == (None if rate is None else pytest.approx(rate))
        assert csv_table.columns(path, names, False)[0].values.size == 3 - ("x;y" in text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,a\n0,1\n1,2\n5,3\n6,1\n", "time steps"), ("time,a\n0,1\n0,2\n0,1\n", "does not rise"),
        ("time,a\n0,1\n1,x\n", "counted from line 2"),
        ("time,a\n0,1\n1,2\n2\n", "counted from line 2"), ("a,b\n", "no row of numbers"),
        ("", "file is empty"), ("a,b\n1,2\n", "at least 2"),
        ("time,a\n0,1\n1,nan\n2,3\n", "not a finite number"), ("\x00\x01", "not a text table"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    mapping = ForeignMapping("csv", (MappedChannel(Role.MEASUREMENT, "a"),), SETUP)
    if text.startswith("a,b\n1"):
        mapping = replace(mapping, sample_rate_hz=1e6)
    with pytest.raises(RecordingError, match=said) as refusal:
        read_foreign(path, mapping)
    assert "\n" not in str(refusal.value) and "t.csv" in str(refusal.value)


def test_what_a_mapping_cannot_do_is_one_line(volts: Volts, tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    mapping = mapping_for(path, write_wav(path, volts)) if write_wav(path, volts) else None
    assert mapping is not None
    for wrong, said in (
        (replace(mapping, format="tdms"), "its mapping is for tdms"),
        (replace(mapping, channels=(MappedChannel(Role.MEASUREMENT, "PD7"),)), "no channel 'PD7'.*channel 1"),
    ):
        with pytest.raises(RecordingError, match=said):
            read_foreign(path, wrong)
    assert read_foreign(path, replace(mapping, trigger_sample=10**9)).flags == ("trigger_lost",)
    with pytest.raises(RecordingError, match="no format"):
        foreign_channels(tmp_path / "a.xlsx")
    with pytest.raises(RecordingError, match="no such file"):
        foreign_channels(tmp_path / "b.wav")


def test_claims_without_bound_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("x", shape=(10**12,), dtype="f8", chunks=(1000,))
    with pytest.raises(RecordingError, match="more than"):
        foreign_channels(path)
    with h5py.File(path, "w") as file:
        one = file.create_dataset("x", shape=(6 * 10**7,), dtype="f8", chunks=(6 * 10**7,), compression="gzip")
        one.id.write_direct_chunk((0,), bytes(200_000))  # of what would be unpacked to 480 MB
        (tmp_path / "outside").write_bytes(bytes(16))
        file.create_dataset("y", shape=(2,), dtype="f8", external=[("outside", 0, 16)])
        file.create_dataset("w", shape=(5 * 10**7,), dtype="f8", chunks=(1000,))
        file["z"] = h5py.ExternalLink("elsewhere.h5", "/x")
    assert [c.name for c in foreign_channels(path).channels] == ["w", "x", "y"]
    for name, said in (("w", "more samples than"), ("x", "pieces too large"), ("y", "in other files")):
        mapping = ForeignMapping("hdf5", (MappedChannel(Role.MEASUREMENT, name),), SETUP, 1e6)
        with pytest.raises(RecordingError, match=said):
            read_foreign(path, mapping)
    wav = tmp_path / "cut.wav"
    head = struct.pack("<4sI4s", b"RIFF", 2**32 - 1, b"WAVE")
    head += struct.pack("<4sIHHIIHH", b"fmt ", 16, 1, 1, 1000, 2000, 2, 16) + struct.pack("<4sI", b"data", 2**32 - 2)
    wav.write_bytes(head + bytes(64))
    try:
        assert foreign_channels(wav).channels[0].samples <= 32
    except RecordingError as error:
        assert "\n" not in str(error)
    monkeypatch.setattr(foreign_file, "MAX_SAMPLES", 10)
    table = tmp_path / "long.csv"
    table.write_text("a\n" + "1\n" * 11)
    with pytest.raises(RecordingError, match="more than 10"):
        foreign_channels(table)


class Spoilable(list[tuple[str, bytes, ForeignMapping]]):
    """Whole files with their mappings, told briefly where a test fails."""

    def __repr__(self) -> str:
        return f"{len(self)} files"


def test_a_tdms_file_may_lie_or_end_early(volts: Volts, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    with nptdms.TdmsWriter(path) as writer:
        channel = nptdms.ChannelObject("g", "a", np.arange(50, dtype=np.int16), {"NI_Number_Of_Scales": 2**31 - 1})
        writer.write_segment([channel])
    with pytest.raises(RecordingError, match="scales"):
        foreign_channels(path)
    for said in ({"wf_increment": "short", "unit_string": 7}, {"wf_increment": 0.0, "unit_string": 7}):
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment([nptdms.ChannelObject("g", "a", np.arange(50, dtype=np.int16), said)])
        (channel,) = foreign_channels(path).channels  # a property that is no such number counts as none
        assert (channel.name, channel.samples, channel.sample_rate_hz, channel.unit) == ("g/a", 50, None, "7")
    with nptdms.TdmsWriter(path) as writer:
        said = {"NI_Number_Of_Scales": "a few"}
        writer.write_segment([nptdms.ChannelObject("g", "a", np.arange(50, dtype=np.int16), said)])
    with pytest.raises(RecordingError, match="cannot be read as tdms") as refusal:
        foreign_channels(path)
    assert "\n" not in str(refusal.value)
    names = write_tdms(path, volts)
    mapping = mapping_for(path, names)
    path.write_bytes(path.read_bytes()[:-4000])
    assert "truncated" in read_foreign(path, mapping).flags
    assert capfd.readouterr().err == ""


@pytest.fixture(scope="module")
def good(volts: Volts, tmp_path_factory: pytest.TempPathFactory) -> Spoilable:
    folder = tmp_path_factory.mktemp("good")
    made = []
    for name, write in WRITERS.items():
        short = {key: values[:400] for key, values in volts.items()}
        names = write(folder / name, short)
        made.append((name, (folder / name).read_bytes(), mapping_for(folder / name, names)))
    return Spoilable(made)


@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_spoiled_file_is_read_or_refused_in_one_line(good: Spoilable, tmp_path: Path, data: st.DataObject) -> None:
    name, raw, mapping = data.draw(st.sampled_from(good))
    spoiled = bytearray(raw)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, min(len(spoiled), 3000) - 1))
        spoiled[at] = data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        del spoiled[data.draw(st.integers(0, len(spoiled))) :]
    path = tmp_path / name
    path.write_bytes(bytes(spoiled))
    try:
        shot = read_foreign(path, mapping)
    except RecordingError as error:
        assert "\n" not in str(error) and name in str(error)
    else:
        assert isinstance(shot, Recording) and shot.counts.dtype == np.int16


@pytest.mark.parametrize(
    ("name", "stated", "rate_hz"),
    [
        ("sample_rate", 2e6, 2e6),
        ("dt", 4e-9, 250e6),
        ("sample_rate", 0.9e12, 0.9e12),
        ("sample_rate", 1.1e12, None),  # no digitizer samples at a terahertz
        ("sample_rate", float("nan"), None),
        ("sample_rate", "2 MS/s", None),
        ("sample_rate", "2e6", None),  # words, though they look like a number
    ],
)
def test_an_attribute_of_hdf5_is_a_sample_rate_if_it_is_a_possible_number(
    tmp_path: Path, name: str, stated: float | str, rate_hz: float | None
) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["beat"] = np.zeros(10, np.int16)
        file["beat"].attrs[name] = stated
    (channel,) = foreign_channels(path).channels
    assert channel.sample_rate_hz == (None if rate_hz is None else pytest.approx(rate_hz, rel=1e-12))


def test_a_rate_and_a_unit_are_looked_for_outwards_from_the_data_and_written_as_each_program_does(
    tmp_path: Path,
) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["dt"] = 1e-3
        file["outer"] = np.zeros(5)
        file["group/near"] = np.zeros((3, 5), np.int16)  # rows that are longer than they are many: three channels
        file["group"].attrs["FS"] = np.array([2e3])
        file["group/near"].attrs["Units"] = np.bytes_("mV")
        file["group/own"] = np.arange(10, dtype=np.float32).reshape(5, 2)
        file["group/own"].attrs["increment"] = 0.25
        file["group/own"].attrs["unit"] = np.bytes_("x" * 1001)  # too long for a unit
        file["outer"].attrs["unit"] = "V"  # of variable length, which may claim gigabytes
        for name, kind, shape in (
            *(("text", "S3", (5,)), ("cube", "f4", (2, 2, 2)), ("one", "f4", (1,)), ("number", "f4", ())),
            *(("wide", "f4", (65, 65)), ("complex", "c16", (5,))),
        ):
            file[name] = np.zeros(shape, kind)
    found = {one.name: (one.samples, one.kind, one.unit, one.sample_rate_hz) for one in foreign_channels(path).channels}
    near = (5, "int16", "mV", 2e3)
    assert found == {
        "group/near[0]": near,
        "group/near[1]": near,
        "group/near[2]": near,
        "group/own[0]": (5, "float32", "", 4.0),
        "group/own[1]": (5, "float32", "", 4.0),
        "outer": (5, "float64", "", pytest.approx(1e3)),
    }
    second = foreign_columns(foreign_channels(path), ["group/own[1]", "group/near[2]", "outer"])
    assert [column.values.tolist() for column in second] == [[1, 3, 5, 7, 9], [0] * 5, [0] * 5]
    (tmp_path / "b.mat").write_bytes(b"MATLAB 5.0 MAT-file")
    with pytest.raises(RecordingError, match="save it with -v7"):
        foreign_channels(tmp_path / "b.mat")


@pytest.mark.parametrize(
    ("step", "rate"), [(2e-12, 5e11), (0.9e-12, None), (0.9e12, 1 / 0.9e12), (1.1e12, None), (-1.0, None)]
)
def test_a_step_of_tdms_is_a_rate_if_it_is_a_possible_one_and_counts_keep_their_one_scale(
    step: float, rate: float | None, tmp_path: Path
) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    scale = {
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": -0.25, "NI_Scale[0]_Linear_Y_Intercept": -3.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }  # fmt: skip
    numbers = np.arange(50)
    lines = [
        nptdms.ChannelObject("g", "counts", numbers.astype(np.int16), {"wf_increment": step, **scale}),
        nptdms.ChannelObject("g", "wide", numbers.astype(np.int32), {"wf_increment": step, **scale}),
        nptdms.ChannelObject("g", "plain", numbers.astype(np.float32), {"unit_string": "u" * 30}),
        nptdms.ChannelObject("g", "single", np.zeros(1)),  # one number is no channel
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(lines)
    held = foreign_channels(path)
    known = [("g/counts", "", rate), ("g/wide", "", rate), ("g/plain", "u" * 17 + "...", None)]
    assert [(one.name, one.unit, one.sample_rate_hz) for one in held.channels] == [
        (name, unit, rate and pytest.approx(rate)) for name, unit, rate in known
    ]
    counts, wide, plain = foreign_columns(held, ["g/counts", "g/wide", "g/plain"])
    assert (counts.values.tolist(), counts.volts_per_unit, counts.offset_v) == (numbers.tolist(), -0.25, -3.0)
    assert (wide.values.tolist(), wide.volts_per_unit, wide.offset_v) == ((-0.25 * numbers - 3).tolist(), None, 0.0)
    assert (plain.values.tolist(), plain.sample_rate_hz) == (numbers.tolist(), None)


@pytest.mark.parametrize(("off", "agree"), [(0.0, True), (1e-12, True), (1e-6, False), (1.0, False)])
def test_channels_sampled_at_different_rates_are_no_shot(off: float, agree: bool, tmp_path: Path) -> None:
    """A rate that went through a text or a step between samples is off by rounding alone."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "two.h5"
    with h5py.File(path, "w") as file:
        for name, rate in (("PD0", RATE), ("PD1", RATE * (1.0 + off))):
            file[name] = np.sin(np.arange(1000))
            file[name].attrs["sample_rate"] = rate
    mapped = MappedChannel(Role.MEASUREMENT, "PD1"), MappedChannel(Role.REFERENCE, "PD0")
    mapping = ForeignMapping("hdf5", mapped, SETUP)
    if agree:
        assert read_foreign(path, mapping).sample_rate_hz == pytest.approx(RATE)
        return
    with pytest.raises(RecordingError, match="different rates"):
        read_foreign(path, mapping)
