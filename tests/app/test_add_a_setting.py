"""Follow docs/add-a-setting.md with the code there: a declared field reaches every file, the sheet and each command."""

import json
import pickle
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.findings.model_file import SavedModel, from_text, to_text
from analysis.diagnosis.findings.result import Errors, Verdict
from analysis.shot.quantity import Quantity
from analysis.shot.shot import PlotNote
from app.command_line import options, parser
from app.command_line.campaign.task import tasks_of
from app.session import entry as entry_module
from app.session import settings_store
from app.session import workbench as workbench_module
from app.session.jobs import EventKind
from app.session.result_archive import packed, unpacked
from app.session.session import Session
from app.session.settings import FIELDS, Settings
from app.session.verdict_basis import VerdictBasis
from app.session.workbench import Workbench
from app.window.panels.settings_sheet import SettingsSheet
from levimass import settings as declarations
from levimass.settings import AnalysisSettings, setting_of, settings_of
from tests.app import synthetic
from tests.pages import code_blocks

UNDECLARED = {  # another value for each field that declares none
    "fit": False,
    "effects": (effect_named("viscous_drag"),),
    "corrections": (("moving_mass_kg", 0.02), ("wavelength_air_m", None)),
    "source": "scpi:scope",
    "network": "scpi:scope",
    "tour_done": True,
    "session": "/data/a.json",
    "recent": "/data/b.json",
    "window": "words",
}


def _as_the_page_has_it():
    """Return the settings and one more, declared in ``levimass/settings.py`` as on the page."""
    (field,) = code_blocks("add-a-setting.md")
    names = vars(declarations) | {"__name__": __name__}
    exec(f"@dataclass(frozen=True, slots=True)\nclass WithGain(AnalysisSettings):\n    {field}", names)
    return names["WithGain"]


WithGain = _as_the_page_has_it()


def _other(of):
    """Return a value of a field that is not its default."""
    setting = setting_of(of)
    if setting is None:
        return UNDECLARED[of.name]
    if setting.kind == "number":
        return setting.low + 0.25 * (setting.high - setting.low)
    if setting.kind == "choice":
        return next(stored for stored, _ in setting.choices if stored != of.default)
    return {"flag": not of.default, "numbers": f"{setting.low:g} {setting.high:g}", "folder": "/elsewhere"}[
        setting.kind
    ]


def changed(kind=AnalysisSettings):
    """Return settings of which no field has its default."""
    return kind(**{of.name: _other(of) for of in fields(kind)})


@pytest.mark.parametrize("kind", [AnalysisSettings, WithGain])
def test_every_field_survives_a_session(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(entry_module, "AnalysisSettings", kind)
    session = Session(tmp_path / "session.json")
    session.add(replace(synthetic.bare_shot("shot-1"), path="/data/1"))
    session.add(
        replace(synthetic.bare_shot("shot-2"), path="/data/2", settings=changed(kind), note="a note"), copy_of=1
    )
    found = VerdictBasis((effect_named("tilt"),), (effect_named("adhesion"),), (1, 2), Verdict.EFFECT_FOUND)
    session.set_verdict(2, found)
    session.change_plot_note(2, None, PlotNote("force", 0.01, 0.5, "the plate's own note"))
    before, after = session.entries[1], Session.reopen(tmp_path / "session.json").entries[1]
    for of in fields(before):
        if of.name not in ("shot", "version"):
            assert getattr(after, of.name) == getattr(before, of.name) != of.default, of.name


def test_what_a_session_holds_that_is_not_known_is_said(tmp_path):
    path = tmp_path / "session.json"
    Session(path).add(replace(synthetic.bare_shot("shot-1"), path="/data/1"))
    document = json.loads(path.read_text())
    document["shots"][0]["settings"]["colour"] = 2.0
    path.write_text(json.dumps(document))
    session = Session.reopen(path)
    assert len(session.entries) == 1 and "colour" in session.problem


@pytest.mark.parametrize("kind", [AnalysisSettings, WithGain])
def test_every_field_reaches_a_campaigns_worker_and_makes_another_task(kind):
    found, whole = [Path("/data/a.csv")], changed(kind)
    (usual,), (task,) = (tasks_of(found, None, settings, None) for settings in (kind(), whole))
    assert pickle.loads(pickle.dumps(task)).settings == whole
    for of in fields(kind):
        (one,) = tasks_of(found, None, replace(kind(), **{of.name: getattr(whole, of.name)}), None)
        assert one.stamp != usual.stamp, of.name


def test_every_field_survives_the_settings_file_and_a_kept_result(tmp_path):
    air = {"temperature_c": 20.0, "pressure_pa": 1e5, "humidity_percent": 40.0}
    apart = air | {"switch_low_v": 1.0, "switch_high_v": 2.0, "pre_trigger_s": 0.01, "duration_s": 0.1}
    whole = replace(Settings(), **{of.name: apart.get(of.name, _other(of)) for of in fields(Settings)})
    assert settings_store.save(tmp_path / "settings.json", whole) is None
    after, words = settings_store.load(tmp_path / "settings.json")
    assert after == whole and not words
    assert all(getattr(after, of.name) != of.default for of in fields(Settings))
    for of in fields(after.analysis):
        if hasattr(after, of.name):
            assert getattr(after.analysis, of.name) == getattr(whole, of.name)
    shot = replace(synthetic.bare_shot("shot-1"), settings=changed())
    (tmp_path / "kept.npz").write_bytes(packed({}, shot))
    assert unpacked(tmp_path / "kept.npz") == shot


def test_every_field_survives_a_model_file():
    q, errors = Quantity(1.5, 0.25, "model file"), Errors(1e-9, 1e-6, 1e-3, 1.25)
    drag = (effect_named("viscous_drag"),)
    model = SavedModel("contact", drag, {"a": q}, np.eye(1), ("s",), {"before": errors}, {"b": q}, drag)
    after = from_text(to_text(model))
    for of in fields(SavedModel):
        before, now = getattr(model, of.name), getattr(after, of.name)
        assert len(before) and (np.array_equal(now, before) if of.name == "covariance" else now == before), of.name


def test_a_flag_is_parsed_helped_and_bounded_as_it_is_declared(monkeypatch, capsys):
    for module in (options, parser):
        monkeypatch.setattr(module, "AnalysisSettings", WithGain)
    gain = next(setting for setting in settings_of(WithGain) if setting.key == "gain")
    monkeypatch.setattr(options, "CHOSEN", (*options.CHOSEN, gain))
    replays = next(group for group in options.GROUPS if group.commands == ("replay",))
    more = replace(replays, options=(*replays.options, options._of_setting(gain)))
    monkeypatch.setattr(options, "GROUPS", (more, *(group for group in options.GROUPS if group is not replays)))
    for call in (["--replay", "x"], ["replay", "x"]):
        for setting in options.CHOSEN:
            value = f"{(setting.low + setting.high) / 2.0:g}"
            found = parser.settings_from(parser.parse([*call, setting.flag, value]))
            assert getattr(found, setting.key) == float(value)
            with pytest.raises(SystemExit):
                parser.parse([*call, setting.flag, f"{2.0 * setting.high:g}"])
            assert setting.words in capsys.readouterr().err
    assert "--gain G of nothing (1)" in " ".join(parser.command_parser("replay").format_help().split())


def test_the_sheet_offers_what_is_declared(qtbot):
    sheet = SettingsSheet()
    qtbot.addWidget(sheet)
    sheet.show_values(Settings().values())
    assert {"fit_seconds", "diagnosis_seconds"} <= {setting.key for setting in FIELDS}
    sheet._editors["diagnosis_seconds"].setText("7.5")
    with qtbot.waitSignal(sheet.applied) as applied:
        sheet.apply()
    assert replace(Settings(), **applied.args[0]).analysis.diagnosis_seconds == 7.5


def test_the_window_diagnoses_within_the_seconds_that_are_set_and_says_what_was_left_out(monkeypatch):
    asked = []

    def diagnose(shots, accepted, laws, seconds, **_):
        asked.append(seconds)
        return replace(synthetic.diagnosis(shot), not_asked=("laws in the contact",))

    monkeypatch.setattr(workbench_module, "diagnose_shots", diagnose)
    shot = synthetic.shot()
    bench = Workbench(Session(), lambda: AnalysisSettings(diagnosis_seconds=7.5))
    try:
        bench.add_shot(shot)
        assert bench.diagnose([1]) is None
        end, events = time.monotonic() + 30.0, []
        while not any(event.kind is EventKind.DIAGNOSED for event in events) and time.monotonic() < end:
            events += bench.poll()
            time.sleep(0.01)
        assert asked == [7.5]
        assert [event.words for event in events if event.kind is EventKind.PROBLEM] == [
            "not computed within the diagnosis time limit (F2): laws in the contact"
        ]
    finally:
        bench.close()
