"""Tables of numbers as many programs write them: columns, units, time and rate, against what was written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Channel, Recording, Role, Setup
from instrument.files import csv_table
from instrument.files.foreign_file import ForeignColumn, ForeignMapping, MappedChannel
from instrument.files.foreign_reading import _bits, _channel, _is_clipped, _rate, _triggered, to_counts
from instrument.files.recording_error import RecordingError

ROWS = [(0.0, 1.0, 5.0), (0.5, 2.0, 6.0), (1.0, 3.0, 7.0), (1.5, 4.0, 9.0)]


UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6, "\u03bcs": 1e-6, "ns": 1e-9}


def _table(path: Path, header: str, rows: list[tuple[float, ...]] = ROWS, end: str = "\n") -> Path:
    path.write_text(header + "\n".join(",".join(map(str, row)) for row in rows) + end, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "names", "units", "rate"),
    [
        ("Time (ms),PD0 [V],PD1\n", ("PD0", "PD1"), ("V", ""), 2e3),
        ("time,a,b\n(us),(mV),(V)\n", ("a", "b"), ("mV", "V"), 2e6),
        *((f"t ({unit}),a,b\n", ("a", "b"), ("", ""), 2.0 / scale) for unit, scale in UNITS.items()),
        ("t_ns,a,a\n", ("a", "a (2)"), ("", ""), 2e9),
        ("t,(V),b [mV]\n", ("(V)", "b"), ("V", "mV"), 2.0),  # a unit alone is the name too
        ("Zeit,,b\n", ("column 2", "b"), ("", ""), 2.0),
        ("a,x [s],b\n", ("a", "b"), ("", ""), 1.0),  # seconds are a time, whatever the name
        ("a,b,c\n", ("a", "b", "c"), ("", "", ""), None),
        ("", ("column 1", "column 2", "column 3"), ("", "", ""), None),
        ("X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-1.2,4.0e-03\n", ("X", "CH1", "CH2"), ("", "", ""), 250.0),
    ],
)
@pytest.mark.parametrize("end", ["\n", ""])
def test_columns_units_and_rate_are_found_in_the_header(tmp_path, header, names, units, rate, end) -> None:
    found = csv_table.contents(_table(tmp_path / "a.csv", header, end=end))
    assert tuple(one.name for one in found.channels) == names
    assert tuple(one.unit for one in found.channels) == units
    assert [one.sample_rate_hz for one in found.channels] == [pytest.approx(rate) if rate else None] * len(names)
    assert {one.samples for one in found.channels} == {4} and found.format == "csv"


def test_the_first_row_stands_among_the_first_200_lines_and_a_name_has_60_letters_at_most(tmp_path) -> None:
    for lines, read in ((199, True), (200, False)):
        path = _table(tmp_path / "a.csv", "remark\n" * (lines - 1) + "a,b,c\n")
        if read:
            assert csv_table.columns(path, ["b"], False)[0].values.tolist() == [1.0, 2.0, 3.0, 4.0]
        else:
            with pytest.raises(RecordingError, match="no row of numbers in its first 200 lines"):
                csv_table.contents(path)
    found = csv_table.contents(_table(tmp_path / "b.csv", f"{'x' * 61},{'y' * 60},{'y' * 60}\n"))
    assert [one.name for one in found.channels] == ["x" * 57 + "...", "y" * 60, "y" * 60 + " (2)"]
    many = ",".join(f"c{n}" for n in range(300)) + "\n"
    rows = [tuple(float(n) for n in range(300))] * 2
    assert len(csv_table.contents(_table(tmp_path / "c.csv", many, rows)).channels) == 256
    thrice = csv_table.contents(_table(tmp_path / "d.csv", "u,u,u\n"))
    assert [one.name for one in thrice.channels] == ["u", "u (2)", "u (3)"]


def test_a_file_is_a_table_up_to_two_gibibytes_whose_first_row_stands_in_its_first_quarter_mebibyte(tmp_path) -> None:
    path = tmp_path / "a.csv"
    for size, why in ((2 * 2**30, "not a text table"), (2 * 2**30 + 1, "larger than 2048 MiB")):
        with path.open("wb") as file:
            file.truncate(size)  # holds nothing, so that it takes no room
        with pytest.raises(RecordingError, match=why):
            csv_table.contents(path)
    for cut, read in ((0, True), (1, False)):  # what may be cut is no row
        table = "a,b\n1,2\n3,4\n"
        path.write_text("x" * (2**18 - 1 - len("a,b\n1,2\n3") + cut) + "\n" + table)
        if read:
            assert csv_table.columns(path, ["b"], False)[0].values.tolist() == [2.0, 4.0]
        else:
            with pytest.raises(RecordingError, match="no row of numbers in its first 2 lines"):
                csv_table.contents(path)


@pytest.mark.parametrize("header", ["4\n", "logger\n4\nin volts\n7,8\n", "1,2,3\n", "4\nfrom\n2026,11\n27\n9,9\n"])
def test_numbers_that_stand_above_the_words_of_a_table_are_none_of_its_rows(tmp_path, header) -> None:
    path = _table(tmp_path / "a.csv", f"{header}time,PD0,PD1\n")
    assert [one.name for one in csv_table.contents(path).channels] == ["PD0", "PD1"]
    assert csv_table.columns(path, ["PD1"], True)[0].values.tolist() == [5.0, 6.0, 7.0, 9.0]


def test_a_row_without_a_value_is_one_of_the_table(tmp_path) -> None:
    path = _table(tmp_path / "a.csv", "time,a\n", [("0", "nan"), ("1", "-INF"), ("2", "NaN"), ("3", "4")])
    values = csv_table.columns(path, ["a"], True)[0].values
    np.testing.assert_array_equal(values, [np.nan, -np.inf, np.nan, 4.0])


def test_a_row_that_lacks_a_number_is_not_passed_over_as_if_the_table_began_below_it(tmp_path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("a;b\n0.5;1\n2\n3;4\n5;6\n")
    with pytest.raises(RecordingError, match="no row of numbers"):
        csv_table.contents(path)


def test_a_time_alone_is_a_channel(tmp_path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time\n1\n2\n4\n")
    (alone,) = csv_table.contents(path).channels
    assert (alone.name, alone.samples, alone.sample_rate_hz) == ("time", 3, None)


def test_quoted_numbers_with_decimal_commas_between_tabs_or_blanks_are_read(tmp_path) -> None:
    for text in (
        'a\tb\n"1,5"\t"-2,5e3"\n"0,25"\t"7"\n',
        "a b\n1,5  -2,5e3\n0,25  7\n",
        "a;b;\n1,5;-2,5e3;\n0,25;7;\n",
        'a,b\n"1.5","-2.5e3"\n".25","7."\n',
    ):
        path = tmp_path / "a.csv"
        path.write_text(text, encoding="utf-8")
        found = [column.values.tolist() for column in csv_table.columns(path, ["b", "a"], False)]
        assert found == [[-2500.0, 7.0], [1.5, 0.25]], text
        assert [(one.name, one.samples, one.kind) for one in csv_table.contents(path).channels] == [
            *(("a", 2, "text"), ("b", 2, "text"))
        ]


def test_a_table_longer_than_is_read_at_once_is_read_to_its_end(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(csv_table, "_ROWS", 7)
    path = _table(tmp_path / "a.csv", "a,b,c\n", [(n, n + 0.5, -n) for n in range(22)])
    b, c = csv_table.columns(path, ["b", "c"], False)
    assert b.values.tolist() == [n + 0.5 for n in range(22)] and c.values.tolist() == [-n for n in range(22)]
    path.write_text(path.read_text() + "x,1,2\n1,y,2\n")
    with pytest.raises(RecordingError, match="counted from line 23"):  # the block of seven rows that begins there
        csv_table.columns(path, ["b"], False)
    for spoilt in ("1,2#3", "1,2 # remark"):  # no number, and no comment either
        path.write_text(f"a,b\n1,2\n{spoilt}\n")
        with pytest.raises(RecordingError, match="counted from line 2"):
            csv_table.columns(path, ["b"], False)
    monkeypatch.setattr(csv_table, "MAX_SAMPLES", 22)
    csv_table.columns(_table(tmp_path / "b.csv", "a,b\n", [(n, n) for n in range(22)]), ["b"], False)
    with pytest.raises(RecordingError, match="more than 22 rows"):
        csv_table.columns(_table(tmp_path / "c.csv", "a,b\n", [(n, n) for n in range(23)]), ["b"], False)


def test_a_rate_is_read_from_a_thousand_rows_and_must_be_even_in_all(tmp_path) -> None:
    path = _table(tmp_path / "a.csv", "t,a\n", [(0.25 * n, n) for n in range(1500)])
    assert csv_table.contents(path).channels[0].sample_rate_hz == pytest.approx(4.0)
    (column,) = csv_table.columns(path, ["a"], True)
    assert column.sample_rate_hz == pytest.approx(4.0) and column.values.tolist() == list(range(1500))
    assert csv_table.columns(path, ["a"], False)[0].sample_rate_hz is None
    for rows, rate in ((1000, 4.0), (999, 999 / 250.75)):  # after which the table takes longer steps
        path = _table(tmp_path / "c.csv", "t,a\n", [(0.25 * n + max(0, n - rows + 1), n) for n in range(1200)])
        assert csv_table.contents(path).channels[0].sample_rate_hz == pytest.approx(rate, rel=1e-9)
    path = _table(tmp_path / "b.csv", "a,t,b\n", [(n * n, 0.25 * n, -n) for n in range(9)])
    for names in (["a", "b"], ["b", "a"]):
        assert [one.sample_rate_hz for one in csv_table.columns(path, names, True)] == [4.0, 4.0]


def test_a_header_may_hold_what_ends_a_page_or_a_paragraph(tmp_path) -> None:
    for header in ("page\x0c\n", "a\x0bb\u2028c\u0085d\n", "one\r\ntwo\r\n"):
        path = tmp_path / "a.csv"
        path.write_text(f"{header}a,b\n1,2\n3,4\n5,6\n", encoding="utf-8", newline="")
        assert [one.samples for one in csv_table.contents(path).channels] == [3, 3]
        assert csv_table.columns(path, ["b"], False)[0].values.tolist() == [2.0, 4.0, 6.0]


@pytest.mark.parametrize(("off", "even"), [(0.39, True), (0.41, False)])
def test_steps_of_time_may_err_by_two_fifths_of_a_step(tmp_path, off, even) -> None:
    rows = [(float(n), 0.0) for n in range(9)]
    rows[4] = (4.0 + off, 0.0)
    path = _table(tmp_path / "a.csv", "t,a\n", rows)
    if even:
        assert csv_table.columns(path, ["a"], True)[0].sample_rate_hz == pytest.approx(1.0)
    else:
        with pytest.raises(RecordingError, match=r"not equal \(line 6\)"):
            csv_table.columns(path, ["a"], True)
    micro = _table(tmp_path / "c.csv", "t,a\n", [(f"{1e-6 * t:.9f}", a) for t, a in rows])
    assert csv_table.contents(micro).channels[0].sample_rate_hz == pytest.approx(1e6)
    if even:
        assert csv_table.columns(micro, ["a"], True)[0].sample_rate_hz == pytest.approx(1e6)
    else:
        with pytest.raises(RecordingError, match="not equal"):
            csv_table.columns(micro, ["a"], True)
    falling = _table(tmp_path / "b.csv", "t,a\n", rows[::-1])
    with pytest.raises(RecordingError, match="does not rise"):
        csv_table.columns(falling, ["a"], True)


def test_a_column_comes_with_its_time_or_with_a_rate_that_is_given_or_stated(tmp_path) -> None:
    uneven = _table(tmp_path / "a.csv", "a,t [ms]\n", [(7, 1), (8, 2), (9, 20)])
    time_s, values = csv_table.timed_column(uneven, "a", None)
    assert time_s == pytest.approx([1e-3, 2e-3, 20e-3]) and values.tolist() == [7, 8, 9]
    assert csv_table.timed_column(uneven, "a", 4.0)[0].tolist() == [0.0, 0.25, 0.5]
    stated = _table(tmp_path / "b.csv", "A,B,Start,Increment\nx,y,0,0.5\n", [(1, 2), (3, 4)])
    assert [part.tolist() for part in csv_table.timed_column(stated, "B", None)] == [[0.0, 0.5], [2, 4]]
    for timed, rate in ((True, 2.0), (False, None)):
        assert csv_table.columns(stated, ["B"], timed)[0].sample_rate_hz == rate
    for value in ("a lot", "0", "-0.5"):  # no step
        unstated = _table(tmp_path / "e.csv", f"A,B,Start,Increment\nx,y,0,{value}\n", [(1, 2), (3, 4)])
        assert {one.sample_rate_hz for one in csv_table.contents(unstated).channels} == {None}
    with pytest.raises(RecordingError, match="no column is the time"):
        csv_table.timed_column(_table(tmp_path / "c.csv", "a,b\n", [(1, 2), (3, 4)]), "b", None)
    with pytest.raises(RecordingError, match="1 rows of numbers, at least 2"):
        csv_table.columns(_table(tmp_path / "d.csv", "a,b\n", [(1, 2)]), ["b"], False)


def test_a_bad_row_is_told_with_the_line_from_which_it_is_counted(tmp_path) -> None:
    path = _table(tmp_path / "a.csv", "t,a\n", [(n, n) for n in range(5)])
    path.write_text(path.read_text() + "5,x\n")
    with pytest.raises(RecordingError, match=r"counted from line 2"):
        csv_table.columns(path, ["a"], False)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int32])
def test_wide_numbers_become_counts_within_half_a_step_of_the_range_they_span(kind) -> None:
    values = (1000.0 * np.sin(np.arange(5000)) + 300.0).astype(kind)
    counts, unit, offset = to_counts(values)
    span = float(values.max()) - float(values.min())
    assert unit == pytest.approx(span / 64_000) and offset == pytest.approx(float(values.max()) - span / 2)
    assert (counts.min(), counts.max()) == (-32_000, 32_000)
    assert np.abs(counts * unit + offset - values).max() <= 0.5 * unit * (1 + 1e-9)
    flat = to_counts(np.full(5, 7.0))
    assert flat[0].tolist() == [0] * 5 and flat[1:] == (1.0, 7.0)


@pytest.mark.parametrize(
    ("at_top", "next_to_it", "clipped"), [(40, 9, True), (40, 10, False), (7, 0, False), (8, 1, True), (8, 2, False)]
)
def test_a_beat_is_clipped_that_is_at_its_extreme_more_than_four_times_as_often_as_beside_it(
    at_top, next_to_it, clipped
) -> None:
    values = np.concatenate((np.full(at_top, 3.0), np.full(next_to_it, 2.9), np.linspace(-2.5, 2.5, 1000)))
    assert _is_clipped(values, 3.0, -1) == clipped == _is_clipped(-values, -3.0, 1)
    for tops, enough in ((10, False), (11, True)):  # of 10,000 samples: a thousandth, and more
        many = np.concatenate((np.full(tops, 3.0), np.linspace(-2.5, 2.5, 10_000 - tops)))
        assert _is_clipped(many, 3.0, -1) == enough
    counts = to_counts(values)[0]
    assert abs(int(counts.max())) == (32_767 if clipped else 32_000)


def test_bits_and_rate_of_columns() -> None:
    mapping = ForeignMapping("wav", (MappedChannel(Role.MEASUREMENT, "a"),), Setup(0.01, digitizer_bits=12))

    def column(kind: type, rate: float | None = 1e6) -> ForeignColumn:
        return ForeignColumn(np.zeros(3, kind), None, 0.0, rate)

    for kinds, bits in (((np.int16,), 12), ((np.int8,), 8), ((np.int8, np.uint16), 12), ((np.int16, np.int32), 16)):
        assert _bits(mapping, [column(kind) for kind in kinds]) == bits
    assert _bits(mapping, [column(np.float64)]) == 16
    path = Path("a.wav")
    assert _rate(path, mapping, [column(np.int8), column(np.int8, 1e6 * (1 + 5e-10))]) == pytest.approx(1e6)
    with pytest.raises(RecordingError, match="different rates"):
        _rate(path, mapping, [column(np.int8), column(np.int8, 1e6 * (1 + 2e-9))])
    for columns in ((None, 1e6), (1e6, None)):  # a channel without a rate has that of the others
        assert _rate(path, mapping, [column(np.int8, rate) for rate in columns]) == 1e6
    with pytest.raises(RecordingError, match="does not state"):
        _rate(path, mapping, [column(np.int8, None)])


@pytest.mark.parametrize(
    ("kind", "column", "mapped", "volts"),
    [
        # what is stored, its scale in the file, the scale of the mapping, and the volts of stored 16 and 100
        (np.float64, (None, 0.0), (None, None), (16.0, 100.0)),
        (np.float64, (None, 0.0), (0.5, None), (8.0, 50.0)),
        (np.float64, (None, 0.0), (None, 2.0), (18.0, 102.0)),
        (np.float64, (None, 0.0), (0.5, 2.0), (10.0, 52.0)),
        (np.int16, (None, 0.0), (None, None), (16 / 32768, 100 / 32768)),  # the full scale of integers is 1 V
        (np.int8, (None, 0.0), (None, None), (16 / 128, 100 / 128)),
        (np.uint8, (None, 0.0), (None, None), (16 / 128, 100 / 128)),
        (np.int32, (None, 0.0), (None, None), (16 / 2**31, 100 / 2**31)),
        (np.int16, (0.25, -3.0), (None, None), (1.0, 22.0)),
        (np.int16, (0.25, -3.0), (None, 5.0), (9.0, 30.0)),  # an offset that is given goes before the file's
        (np.int16, (0.25, -3.0), (2.0, None), (32.0, 200.0)),  # and a scale before both
        (np.uint16, (0.25, -3.0), (-2.0, 1.0), (-31.0, -199.0)),
    ],
)
def test_a_channel_has_the_volts_of_the_mapping_else_of_the_file_else_of_a_full_scale_of_one(
    kind: type, column: tuple[float | None, float], mapped: tuple[float | None, ...], volts: tuple[float, ...]
) -> None:
    into = np.empty(2, np.int16)
    stored = ForeignColumn(np.array([16, 100, 77], kind), *column)
    channel = _channel(Path("a"), MappedChannel(Role.SWITCH, "c", *mapped), stored, into)
    assert channel.role is Role.SWITCH
    assert into * channel.volts_per_count + channel.offset_v == pytest.approx(volts, rel=1e-9)
    with pytest.raises(RecordingError, match=r"^a: c: sample 1 is not a finite number$"):
        _channel(Path("a"), MappedChannel(Role.SWITCH, "c"), ForeignColumn(np.array([0.0, np.inf])), into)


def test_the_trigger_of_a_foreign_file_is_the_given_one_or_the_first_step_of_its_switch() -> None:
    counts = np.zeros((9000, 2), np.int16)
    counts[5000:, 1] = 40  # of a digitizer of 12 bits a step takes 205 counts, of one that reaches 41 so few
    channels = (Channel(Role.MEASUREMENT, 1.0), Channel(Role.SWITCH, 1.0))
    shot = Recording("s", counts, 1e6, channels, Setup(0.01, digitizer_bits=12))
    path = Path("a")
    assert _triggered(path, shot).trigger_sample == 5000
    assert _triggered(path, replace(shot, trigger_sample=8999)).trigger_sample == 8999
    lost = _triggered(path, replace(shot, trigger_sample=9000, flags=("truncated",)))
    assert (lost.trigger_sample, lost.flags) == (None, ("truncated", "trigger_lost"))
    alone = replace(shot, counts=np.ascontiguousarray(counts[:, :1]), channels=channels[:1])
    assert _triggered(path, alone) is alone
