"""Recordings on disk: round trip, flags, errors, and that a crash leaves the samples so far."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.shot.recording import Gap, Recording
from instrument.files import recording_writer
from instrument.files.atomic_file import write_text_atomic
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import (
    data_hash,
    hash_matches,
    open_recording,
    open_without_hash,
    read_recording,
    read_without_hash,
)
from instrument.files.recording_metadata import read_metadata
from instrument.files.recording_search import find_recordings
from instrument.files.recording_writer import RecordingWriter, rewrite_note, write_recording

FIELDS = ("name", "sample_rate_hz", "channels", "setup", "trigger_sample", "gaps", "started_at", "note", "flags")


def edit(meta: Path, **changes: object) -> None:
    """Change keys of the global object of a metadata file ("lmm_setup" for "lmm:setup"); None removes the key."""
    whole = json.loads(meta.read_text())
    for name, value in changes.items():
        key = name.replace("_", ":", 1)
        if value is None:
            whole["global"].pop(key, None)
        else:
            whole["global"][key] = value
    meta.write_text(json.dumps(whole))


def refusal(path: Path) -> str:
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 700
    return str(caught.value)


def test_what_is_written_is_read_again(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "shot-1")
    for named in (meta, tmp_path / "shot-1.sigmf-data", tmp_path / "shot-1", str(meta)):
        back = read_recording(named)
        for field in FIELDS:
            assert getattr(back, field) == getattr(shot, field), field
        np.testing.assert_array_equal(back.counts, shot.counts)
        assert not back.counts.flags.writeable
        assert back.extra["global"]["lmm:other"] == [1, {"a": None}]
    assert data_hash(meta).agrees
    assert sorted(p.name for p in tmp_path.iterdir()) == ["shot-1.sigmf-data", "shot-1.sigmf-meta"]


def test_annotations_are_written_in_the_order_of_their_samples(shot: Recording, tmp_path: Path) -> None:
    """SigMF demands it: the note at sample 0 stands before a gap at sample 1; a foreign one may lack its sample."""
    foreign = {"annotations": [{"core:comment": "no place"}, {"core:sample_start": 9, "core:comment": "later"}]}
    early = replace(shot, gaps=(Gap(1, 5), Gap(12_000, None)), extra={**shot.extra, **foreign})
    meta = write_recording(early, tmp_path / "a")
    written = json.loads(meta.read_text())["annotations"]
    assert [item.get("core:sample_start") for item in written] == [None, 0, 1, 9, 12_000]


def test_the_field_s_own_package_agrees(shot: Recording, tmp_path: Path) -> None:
    sigmf = pytest.importorskip("sigmf")
    meta = write_recording(shot, tmp_path / "shot-1")
    foreign = sigmf.fromfile(str(meta), autoscale=False)  # checks the hash
    foreign.validate()
    np.testing.assert_array_equal(np.asarray(foreign[0 : shot.samples]), shot.counts)
    assert foreign.get_global_field("core:sample_rate") == 30e6


def test_unknown_keys_travel_along(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "a")
    whole = json.loads(meta.read_text())
    whole["global"]["lmm:future"] = {"x": [1, 2]}
    whole["global"]["lmm:setup"]["optics"] = "new"
    whole["global"]["lmm:setup"]["plate"]["finish"] = "ground"
    whole["global"]["lmm:channels"][1]["amplifier"] = "A7"
    whole["global"]["core:extensions"].append({"name": "zzz", "version": "0.1.0", "optional": True})
    whole["captures"][0]["core:frequency"] = 2.7e6
    whole["annotations"].append({"core:sample_start": 5, "core:label": "spike", "core:comment": "a lorry"})
    whole["collection"] = {"core:version": "1.2.5"}
    meta.write_text(json.dumps(whole))
    again = json.loads(write_recording(read_recording(meta), tmp_path / "b").read_text())
    key = lambda a: json.dumps(a, sort_keys=True)  # noqa: E731
    for part in ("global", "captures", "collection"):
        got, wanted = again[part], whole[part]
        if part == "global":
            assert sorted(map(key, got.pop("core:extensions"))) == sorted(map(key, wanted.pop("core:extensions")))
        assert got == wanted
    assert sorted(map(key, again["annotations"])) == sorted(map(key, whole["annotations"]))


def test_independent_recordings_open(recordings: Path) -> None:
    found = find_recordings([recordings / "paper", recordings / "plain"])
    assert [p.name for p in found] == ["shot-1.sigmf-meta"] * 2 + ["shot-2.sigmf-meta", "shot-3.sigmf-meta"]
    paper = read_recording(found[0])
    assert (paper.samples, paper.trigger_sample, paper.flags) == (5_000_000, 232_077, ())
    assert all(data_hash(p).agrees for p in found[1:])


def test_lengths_that_differ_are_flagged(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "s")
    data = tmp_path / "s.sigmf-data"
    raw = data.read_bytes()
    data.write_bytes(raw[: 6 * 9_000 + 1])
    short = read_recording(meta)
    assert short.samples == 9_000 and "truncated" in short.flags and short.gaps == ()
    data.write_bytes(raw[: 6 * 4_000])
    assert read_recording(meta).trigger_sample is None
    assert {"truncated", "trigger_lost"} <= set(read_recording(meta).flags)
    data.write_bytes(raw + raw[:600])
    longer = read_recording(meta)
    assert longer.samples == shot.samples + 100 and "longer_than_declared" in longer.flags
    assert data_hash(meta).agrees is False
    edit(meta, lmm_samples=None)  # a foreign writer states the length in the extent of its note
    assert "longer_than_declared" in read_recording(meta).flags


def test_what_was_altered_is_told_by_the_hash_alone_and_a_recording_can_be_opened_without_it(
    shot: Recording, tmp_path: Path
) -> None:
    meta = write_recording(shot, tmp_path / "s")
    whole, sha512 = read_without_hash(meta)
    assert sha512 == json.loads(meta.read_text())["global"]["core:sha512"] and hash_matches(whole, sha512.upper())
    data = tmp_path / "s.sigmf-data"
    raw = data.read_bytes()
    data.write_bytes(bytes([raw[0] ^ 1]) + raw[1:])
    assert [open_one(meta).flags for open_one in (open_recording, open_without_hash)] == [
        ("gap", "data_altered"),
        ("gap",),
    ]
    for opened in (open_recording(meta), open_without_hash(meta)):
        assert isinstance(opened, Recording) and opened.counts[0, 0] == shot.counts[0, 0] ^ 1
        assert np.array_equal(opened.counts[1:], shot.counts[1:])
    data.write_bytes(raw[:-6])  # what is not whole has no hash to compare
    assert read_without_hash(meta)[1] is None and "truncated" in open_without_hash(meta).flags


def test_a_beat_at_the_rails_is_flagged(shot: Recording, tmp_path: Path) -> None:
    counts = shot.counts.copy()
    counts[:, 1] = np.clip(counts[:, 1] * 2, -2048, 2047)
    assert "clipped" in read_recording(write_recording(replace(shot, counts=counts), tmp_path / "a")).flags
    counts = shot.counts.copy()
    counts[6_000:, 2] = 2047  # the light switch may sit at the rail
    assert "clipped" not in read_recording(write_recording(replace(shot, counts=counts), tmp_path / "b")).flags


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"core_datatype": "rf32_le"}, "core:datatype"),
        ({"core_datatype": 7}, "core:datatype"),
        ({"core_sample_rate": 0}, "core:sample_rate"),
        ({"core_sample_rate": -1.0}, "core:sample_rate"),
        ({"core_sample_rate": "fast"}, "core:sample_rate"),
        ({"core_sample_rate": True}, "core:sample_rate"),
        ({"core_sample_rate": 10**400}, "core:sample_rate"),
        ({"core_sample_rate": None}, "core:sample_rate"),
        ({"core_num_channels": 2}, "core:num_channels"),
        ({"core_num_channels": 1.5}, "core:num_channels"),
        ({"lmm_channels": None}, "lmm:channels"),
        ({"lmm_channels": []}, "lmm:channels"),
        ({"lmm_channels": {}}, "lmm:channels"),
        ({"lmm_channels": ["a"]}, "lmm:channels[0]"),
        ({"lmm_channels": [{"role": "aux", "volts_per_count": 1}] * 3}, "lmm:channels[0].role"),
        ({"lmm_channels": [{"role": "switch", "volts_per_count": 1}] * 3}, "lmm:channels[1].role"),
        ({"lmm_channels": [{"role": "measurement", "volts_per_count": 0}], "core_num_channels": 1}, "volts_per_count"),
        ({"lmm_channels": [{"role": "reference", "volts_per_count": 1}], "core_num_channels": 1}, "measurement"),
        ({"lmm_setup": None}, "lmm:setup"),
        ({"lmm_setup": {}}, "lmm:setup.moving_mass_kg"),
        ({"lmm_setup": {"moving_mass_kg": [1]}}, "lmm:setup.moving_mass_kg"),
        ({"lmm_setup": {"moving_mass_kg": 1, "air": 3}}, "lmm:setup.air"),
        ({"lmm_setup": {"moving_mass_kg": 1, "digitizer_bits": 99}}, "lmm:setup.digitizer_bits"),
        ({"lmm_trigger": 1, "lmm_trigger_sample": -5}, "lmm:trigger_sample"),
        ({"lmm_trigger_sample": "5"}, "lmm:trigger_sample"),
        ({"core_dataset": "../../etc/passwd"}, "core:dataset"),
        ({"core_dataset": "/etc/passwd"}, "core:dataset"),
    ],
)
def test_refusals_name_file_and_key(shot: Recording, tmp_path: Path, changes: dict[str, object], named: str) -> None:
    meta = write_recording(shot, tmp_path / "s")
    edit(meta, **changes)
    line = refusal(meta)
    assert str(meta) in line and named in line


@pytest.mark.parametrize(
    "text",
    [b"", b"{", b"[1]", b"nonsense", b"\xff\xfe\x00", b"[" * 200_000, b'{"a": NaN}', b'{"a": ' + b"9" * 5000 + b"}"],
)
def test_what_is_no_json_is_refused(shot: Recording, tmp_path: Path, text: bytes) -> None:
    meta = write_recording(shot, tmp_path / "s")
    meta.write_bytes(text)
    assert str(meta) in refusal(meta)


def test_missing_and_odd_files_are_refused(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "s")
    data = tmp_path / "s.sigmf-data"
    assert "no such file" in refusal(tmp_path / "nothing")
    secret = tmp_path.parent / f"{tmp_path.name}-secret.bin"
    shutil.move(data, secret)
    assert "no such file" in refusal(meta) and str(data) in refusal(meta)
    data.symlink_to(secret)
    assert "outside" in refusal(meta)
    data.unlink()
    data.write_bytes(b"\0" * 5)
    assert "no samples" in refusal(meta)
    data.unlink()
    os.mkfifo(data)
    assert "not a regular file" in refusal(meta)


def test_nothing_is_overwritten_and_a_failure_leaves_nothing(shot: Recording, tmp_path: Path) -> None:
    write_recording(shot, tmp_path / "s")
    with pytest.raises(RecordingError, match="exists already"):
        write_recording(shot, tmp_path / "s")
    with pytest.raises(RecordingError, match="folder does not exist"):
        write_recording(shot, tmp_path / "none" / "s")
    with pytest.raises(RecordingError, match="JSON"):
        write_recording(replace(shot, extra={"global": {"x": object()}}), tmp_path / "t")
    assert len(list(tmp_path.iterdir())) == 2


def test_a_link_stays_a_link_and_a_device_a_device(tmp_path: Path) -> None:
    (tmp_path / "link.json").symlink_to(tmp_path / "file.json")
    write_text_atomic(tmp_path / "link.json", "new\udcff", sync=True)
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "file.json").read_text() == "new\\udcff"  # no text, and no reason to fail
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_text_atomic(tmp_path / "pipe", "through", sync=True)
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert (tmp_path / "pipe").is_fifo()
    with pytest.raises(RecordingError, match="a folder, not a file"):
        write_text_atomic(tmp_path, "nothing", sync=True)


def test_a_capture_cut_off_reopens_as_far_as_it_got(shot: Recording, tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "s", shot.sample_rate_hz, shot.channels, shot.setup)
    writer.append(shot.counts[:3_000])
    cut_off = read_recording(tmp_path / "s")
    np.testing.assert_array_equal(cut_off.counts, shot.counts[:3_000])
    assert "interrupted" in cut_off.flags
    assert data_hash(tmp_path / "s").agrees is None
    writer.trigger(2_000)
    writer.gap(2_500, 10)
    writer._refreshed_at = -1e9  # a quarter of a second later
    writer.append(shot.counts[3_000:])
    later = read_recording(tmp_path / "s")
    assert later.trigger_sample == 2_000 and later.gaps[0].samples_lost == 10
    meta = writer.close()
    assert data_hash(meta).agrees and read_recording(meta).flags == ("gap",)


@pytest.mark.parametrize(("every", "value", "clipped"), [(800, 2047, True), (1300, 2047, False), (800, -2048, True)])
def test_a_beat_is_clipped_that_is_at_the_rails_in_more_than_a_thousandth_of_its_samples(
    shot: Recording, tmp_path: Path, every: int, value: int, clipped: bool
) -> None:
    counts = np.zeros((200_000, 3), np.int16)
    counts[::every, 0] = value
    counts[:, 1:] = [-value // 2, value]  # the switch may be at a rail
    found = read_recording(write_recording(replace(shot, counts=counts, gaps=()), tmp_path / "a"))
    assert ("clipped" in found.flags) == clipped
    counts[:, 0] = value - 1 if value > 0 else value + 1  # one count from it
    assert "clipped" not in read_recording(write_recording(replace(shot, counts=counts), tmp_path / "b")).flags


def test_what_changed_is_written_down_four_times_a_second_while_samples_come(
    shot: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, synced = [100.0], []
    monkeypatch.setattr(recording_writer, "time", SimpleNamespace(monotonic=lambda: now[0]))
    write = recording_writer.write_json_atomic
    monkeypatch.setattr(
        recording_writer, "write_json_atomic", lambda *of, sync: (synced.append(sync), write(*of, sync=sync))
    )
    writer = RecordingWriter(tmp_path / "s", shot.sample_rate_hz, shot.channels, shot.setup, started_at="now")
    assert synced == [False] and read_metadata(writer.meta_path).started_at == "now"
    now[0] = 200.0
    writer.append(shot.counts[:10])
    assert len(synced) == 1  # nothing is new
    for change, at, writes in (
        (lambda: writer.trigger(3), 100.25, 1),
        (lambda: writer.gap(4, None), 200.0, 2),
        (lambda: writer.note("n"), 200.25, 2),
        (lambda: writer.more({"global": {"x": 1}}), 200.26, 3),
    ):
        change()
        now[0] = at
        writer.append(shot.counts[:10])
        assert len(synced) == writes
    found = read_metadata(writer.meta_path)
    assert (found.trigger_sample, found.gaps, found.note, found.declared_samples) == (3, (Gap(4, None),), "n", None)
    assert found.extra["global"] == {"x": 1} and writer.samples == 50
    for wrong in (shot.counts[:, :2], shot.counts[0]):
        with pytest.raises(RecordingError, match="do not fit its channels"):
            writer.append(wrong)
    assert writer.close(interrupted=True) == writer.meta_path and synced == [False] * 3 + [True]
    assert read_metadata(writer.meta_path).sha512 is None and writer._file.closed
    writer.release()
    writer.abandon()
    writer.abandon()
    assert list(tmp_path.iterdir()) == []
    kept = RecordingWriter(tmp_path / "s", shot.sample_rate_hz, shot.channels, shot.setup)
    kept.append(shot.counts[:10])
    kept.release()
    assert kept._file.closed and read_recording(tmp_path / "s").samples == 10


def test_a_note_is_changed_in_place(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "s")
    before = read_recording(meta)
    rewrite_note(meta, "better: £ ± \u2028")
    changed = read_recording(meta)
    assert changed.note == "better: £ ± \u2028"
    assert data_hash(meta).agrees and changed.extra == before.extra


def test_a_recording_marked_read_only_keeps_its_note(shot: Recording, tmp_path: Path) -> None:
    meta = write_recording(shot, tmp_path / "s")
    meta.chmod(0o444)
    before = meta.read_bytes()
    with pytest.raises(RecordingError, match="read-only"):
        rewrite_note(meta, "another")
    assert meta.read_bytes() == before


def test_folders_are_searched_in_counting_order(shot: Recording, tmp_path: Path) -> None:
    for name in ("shot-10", "shot-9", "b"):
        write_recording(shot, tmp_path / name)
    (tmp_path / "m.csv").write_text("")
    (tmp_path / "shots.csv").write_text("")
    (tmp_path / "m.toml").write_text("")
    (tmp_path / "orphan.sigmf-data").write_bytes(b"1234")
    names = ["b.sigmf-meta", "m.csv", "orphan.sigmf-meta", "shot-9.sigmf-meta", "shot-10.sigmf-meta"]
    assert [p.name for p in find_recordings([tmp_path])] == names
    twice = [tmp_path / "b.sigmf-data", tmp_path / "b", tmp_path / "m.toml", tmp_path / "no"]
    assert [p.name for p in find_recordings(twice)] == ["b.sigmf-meta", "m.csv", "no"]
    assert find_recordings([tmp_path.parent / tmp_path.name])[0].parent == tmp_path
    empty = tmp_path / "empty"
    empty.mkdir()
    assert find_recordings([empty]) == [empty]
    assert "no such file" in refusal(empty)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4),
    max_leaves=12,
)
KEYS = st.sampled_from(
    [
        "core:datatype",
        "core:num_channels",
        "core:sample_rate",
        "core:version",
        "core:sha512",
        "core:extensions",
        "core:dataset",
        "lmm:channels",
        "lmm:setup",
        "lmm:trigger_sample",
        "lmm:samples",
        "core:trailing_bytes",
    ]
)
SETUP_KEYS = st.sampled_from(
    [
        "moving_mass_kg",
        "moving_mass_u_kg",
        "wavelength_vacuum_m",
        "wavelength_air_m",
        "air",
        "plate",
        "rest_frequency_hz",
        "digitizer_bits",
    ]
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(KEYS, JSON, max_size=2),
    st.dictionaries(SETUP_KEYS, JSON, max_size=2),
    st.one_of(st.none(), JSON),
    st.one_of(st.none(), JSON),
)
def test_hostile_metadata_open_or_are_refused_in_one_line(
    shot: Recording, tmp_path: Path, head: dict, setup: dict, annotations: object, captures: object
) -> None:
    meta = tmp_path / "s.sigmf-meta"
    if not meta.exists():
        write_recording(shot, tmp_path / "s")
        shutil.copy(meta, tmp_path / "good.json")
    whole = json.loads((tmp_path / "good.json").read_text())
    whole["global"].update(head)
    if isinstance(whole["global"].get("lmm:setup"), dict):
        whole["global"]["lmm:setup"].update(setup)
    if annotations is not None:
        whole["annotations"] = annotations
    if captures is not None:
        whole["captures"] = captures
    meta.write_text(json.dumps(whole))
    try:
        back = read_recording(meta)
    except RecordingError as error:
        assert "\n" not in str(error) and str(meta) in str(error)
    else:
        assert back.samples == shot.samples
        again = tmp_path / "again"
        for ending in (".sigmf-meta", ".sigmf-data"):
            Path(str(again) + ending).unlink(missing_ok=True)
        write_recording(back, again)
        assert read_recording(again).setup == back.setup
