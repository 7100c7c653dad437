"""Channels of foreign files are proposed by what their signals are, and exchanged where they are swapped."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Role
from app.session.channel_guess import PART, PARTS, ChannelKind, _lines, proposed_roles, summarise_channels
from app.session.load import load_and_analyse
from app.session.session import Session
from app.session.settings_store import SettingsStore
from app.session.workbench import Workbench
from app.window.controls.theme import Theme
from app.window.panels.layout import Layout
from app.window.panels.mapping_sheet import MappingSheet
from app.window.presenters.mapping import MappingPresenter
from app.window.presenters.selection import SelectionPresenter
from app.window.presenters.session import SessionPresenter
from instrument.bench.simulated_shots import simulate
from instrument.files.foreign_file import ForeignMapping, MappedChannel, mapping_path, read_mapping, write_mapping
from instrument.files.foreign_reading import foreign_channels, read_foreign
from instrument.files.recording_file import open_recording
from instrument.files.recording_writer import write_recording
from tests.app import synthetic
from tests.app.on_screen import read_entries


def _shot(folder: Path, speed: float = 0.25):
    return open_recording(simulate(folder, [speed])[0])


def _scope_csv(path: Path, recording, order) -> None:
    """Write what an oscilloscope writes: a header wider than its rows, and a counter before the channels."""
    columns = [recording.counts[:, c].astype(float) * 1e-3 for c in order]
    step = 1.0 / recording.sample_rate_hz
    lines = [",".join(["X", *(f"CH{n + 1}" for n in range(len(order))), "Start", "Increment"])]
    lines.append(",".join(["Sequence", *["Volt"] * len(order), "0.000000e+00", f"{step:.9e}"]))
    table = np.column_stack(columns)
    lines += [f"{n}," + ",".join(f"{v:.4f}" for v in row) + "," for n, row in enumerate(table)]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_an_oscilloscopes_csv_is_read_with_its_names_and_proposed_by_its_signals(tmp_path, order):
    recording = _shot(tmp_path)
    path = tmp_path / "scope.csv"
    _scope_csv(path, recording, order)
    held = foreign_channels(path)
    assert [channel.name for channel in held.channels] == ["X", "CH1", "CH2", "CH3"]
    assert held.channels[1].sample_rate_hz == pytest.approx(recording.sample_rate_hz)
    looks = summarise_channels(held)
    assert looks[0].kind is ChannelKind.COUNTER
    roles = [recording.channels[c].role for c in order]
    kinds = {Role.REFERENCE: ChannelKind.STILL, Role.MEASUREMENT: ChannelKind.MOVING, Role.SWITCH: ChannelKind.SWITCH}
    assert [look.kind for look in looks[1:]] == [kinds[role] for role in roles]
    wanted = {role: f"CH{place + 1}" for place, role in enumerate(roles)}
    assert dict(proposed_roles(looks)) == wanted
    mapping = ForeignMapping("csv", tuple(MappedChannel(r, n) for r, n in wanted.items()), recording.setup)
    assert read_foreign(path, mapping).sample_rate_hz == pytest.approx(recording.sample_rate_hz)


def test_the_sheet_shows_what_each_channel_is_and_proposes_it(qtbot, tmp_path):
    recording = _shot(tmp_path)
    path = tmp_path / "scope.csv"
    _scope_csv(path, recording, (1, 0, 2))
    held = foreign_channels(path)
    sheet = MappingSheet()
    qtbot.addWidget(sheet)
    sheet.ask(held, 17.85e-3, None, summarise_channels(held))
    assert [sheet.boxes[role].currentData() for role in sheet.boxes] == ["CH1", "CH2", "CH3"]
    words = sheet._looks.text()
    assert "<b>X</b>: row counter" in words and "MHz" in words and "beat, varying frequency" in words


def test_swapped_beats_are_exchanged_for_good(qtbot, tmp_path):
    recording = _shot(tmp_path)
    path = tmp_path / "shot.csv"
    _scope_csv(path, recording, (0, 1, 2))
    wrong = {Role.MEASUREMENT: "CH1", Role.REFERENCE: "CH2", Role.SWITCH: "CH3"}
    mapping = ForeignMapping("csv", tuple(MappedChannel(r, n) for r, n in wrong.items()), recording.setup)
    write_mapping(mapping, mapping_path(path))
    panels = Layout(Theme("light"))
    qtbot.addWidget(panels)
    store = SettingsStore(tmp_path / "settings.json")
    bench = Workbench(Session(), store.analysis)
    try:
        presenter = MappingPresenter(bench, store, panels, panels)
        session = SessionPresenter(bench, store, panels, SelectionPresenter(bench, panels, panels), panels)
        session.swap_wanted.connect(presenter.swap)
        session.open_paths([path])
        qtbot.waitUntil(lambda: (session.refresh(), len(read_entries(bench.session)) == 1)[1], timeout=60_000)
        assert "swapped" in (bench.session.entries[0].shot.problem or "")
        assert panels.work.notices._do.text() == "Swap them"
        panels.work.notices._do.click()
        entries = bench.session
        qtbot.waitUntil(
            lambda: (session.refresh(), read_entries(entries)[0].shot.impact is not None)[1], timeout=60_000
        )
        roles = {channel.role: channel.name for channel in read_mapping(mapping_path(path)).channels}
        assert roles[Role.MEASUREMENT] == "CH2" and len(bench.session.entries) == 1
    finally:
        bench.close()


@pytest.mark.parametrize("speed", [0.1, 0.25, 0.5])
def test_a_recording_with_swapped_beats_says_so_whatever_its_speed(tmp_path, speed):
    """A force of -2.5 N stood under the words that the force never rises above its noise."""
    recording = _shot(tmp_path, speed)
    other = {Role.REFERENCE: Role.MEASUREMENT, Role.MEASUREMENT: Role.REFERENCE}
    channels = tuple(replace(channel, role=other.get(channel.role, channel.role)) for channel in recording.channels)
    write_recording(replace(recording, channels=channels), tmp_path / "swapped")
    assert load_and_analyse(tmp_path / "swapped.sigmf-meta").channels_swapped
    assert not synthetic.shot().channels_swapped


@pytest.mark.parametrize("periods", [3.0, 10.3, 100.7, 0.45 * PART])
def test_a_beat_is_found_at_its_frequency_beside_an_offset(periods):
    """From three periods in a part on: what is slower is no beat but a motion or a drift."""
    samples = np.arange(20 * PART)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, samples.size)
    found = _lines(5.0 + np.sin(2 * np.pi * periods / PART * samples + 0.3) + noise)
    assert found.size == PARTS and found * PART == pytest.approx(periods, abs=0.05)
