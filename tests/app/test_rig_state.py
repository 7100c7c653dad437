"""What the window may do with its digitizer, from what the capture says; each shot is handed over once."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.shot.shot import AnalysisSettings
from app.session.rig import Rig, _OpenSource
from instrument.capture.acquisition import State
from instrument.capture.snapshot import CapturedShot, SignalLine, Snapshot
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.live.live_view import empty_view
from tests.app import synthetic


class Capture:
    """A capture that keeps what it was told."""

    def __init__(self, state: State = State.IDLE) -> None:
        self.told: list[tuple[str, Any]] = []
        self.snapshot = Snapshot(state, 10.0, False, "", "", SignalLine(), empty_view())
        self.ends, self.digitizer_held = True, False

    def latest(self) -> Snapshot:
        return self.snapshot

    def arm(self, automatic: bool) -> None:
        self.told.append(("arm", automatic))

    def abort(self) -> None:
        self.told.append(("abort", None))

    def trigger_now(self) -> None:
        self.told.append(("trigger", None))

    def set_automatic(self, on: bool) -> None:
        self.told.append(("automatic", on))

    def set_options(self, options: Any) -> None:
        self.told.append(("options", options))

    def watch(self, on: bool, *, switch: bool) -> None:
        self.told.append(("watch", (on, switch)))

    def save_pending(self, folder: Path) -> list[Path]:
        return [folder / "a", folder / "b"]

    def close(self) -> bool:
        self.told.append(("close", None))
        return self.ends


@pytest.fixture
def rig():
    """A rig whose source could not be opened, and its clock."""

    def refused(_: str):
        raise DigitizerError("no such device", "plug it in")

    now = [100.0]
    one = Rig(lambda *_: "options", AnalysisSettings, SimpleNamespace(), open_digitizer=refused, clock=lambda: now[0])
    one.open("absent")
    _until(lambda: one.latest().state is State.FAULT and not one._thread.tasks)
    one.now = now
    yield one
    one._running = None
    assert one.close()


def _until(done) -> None:
    end = time.monotonic() + 20.0
    while not done():
        assert time.monotonic() < end
        time.sleep(0.005)


def _runs(rig, state: State = State.IDLE) -> Capture:
    capture = Capture(state)
    rig._running = _OpenSource("bench?seed=1", SimpleNamespace(), capture, ("PD0", "PD1"), 2e6)
    return capture


def test_a_source_that_failed_says_why_and_can_be_armed_to_open_again(rig) -> None:
    told = rig.latest()
    assert (told.state, told.message, told.remedy) == (State.FAULT, "no such device", "plug it in")
    assert told.since_s == 100.0
    assert rig.can_arm(told) and rig.can_abort(told)
    assert (rig.opened, rig.channels, rig.rate_hz) == (None, (), None)
    assert rig.save_pending(Path("x")) == {}
    rig.now[0] = 200.0
    rig.arm()
    _until(lambda: rig.latest().since_s == 200.0 and rig.latest().state is State.FAULT)
    rig.abort()
    idle = rig.latest()
    assert (idle.state, idle.message) == (State.IDLE, "opening the source")
    assert not rig.can_arm(idle) and not rig.can_abort(idle)
    for command in (rig.trigger_now, rig.options_changed, lambda: rig.watch(True, switch=True)):
        command()
    rig.set_rearm(True)
    assert rig.rearm


def test_commands_go_to_the_capture(rig) -> None:
    capture = _runs(rig)
    assert (rig.opened, rig.channels, rig.rate_hz) == ("bench?seed=1", ("PD0", "PD1"), 2e6)
    rig.arm()
    rig.set_rearm(True)
    rig.arm()
    rig.trigger_now()
    rig.watch(False, switch=True)
    rig.options_changed()
    rig.abort()
    assert capture.told == [
        ("arm", False), ("automatic", True), ("arm", True), ("trigger", None), ("watch", (False, True)),
        ("options", "options"), ("abort", None),
    ]  # fmt: skip
    capture.snapshot = replace(capture.snapshot, unsaved=("one", "two"))
    assert rig.save_pending(Path("there")) == {"one": Path("there/a"), "two": Path("there/b")}


def test_settings_that_cannot_be_applied_are_a_problem_told_once(rig) -> None:
    capture = _runs(rig)

    def refused(_: Any) -> None:
        raise OSError("no room")

    capture.set_options = refused
    rig.options_changed()
    assert rig.take_problems() == ["the settings were not applied: no room"] and rig.take_problems() == []


@pytest.mark.parametrize(
    ("state", "arms", "aborts"),
    [
        (State.IDLE, True, False),
        (State.ARMING, False, True),
        (State.ARMED, False, True),
        (State.ANALYSING, True, True),
        (State.FAULT, True, True),
    ],
)
def test_arm_and_abort_are_offered_by_state(rig, state: State, arms: bool, aborts: bool) -> None:
    told = _runs(rig, state).latest()
    assert (rig.can_arm(told), rig.can_abort(told)) == (arms, aborts)


def test_a_shot_is_handed_over_when_it_is_captured_read_and_fitted(rig) -> None:
    whole = synthetic.shot()
    first = replace(whole, fit=None, flags=("fit_to_follow",))
    told = _runs(rig).latest()

    def taken(number: int, shot: Any = None, **more: Any) -> list[CapturedShot]:
        captured = CapturedShot(number, "one", None, CaptureSettings(1e6, 10, 0), shot, **more)
        return rig.take_shots(replace(told, captured=(captured,)))

    (waits,) = taken(1, waits=True)
    assert waits.waits and not waits.fitted_later and taken(1, waits=True) == []
    (one,) = taken(1, shot=first)
    assert one.shot is first and not one.fitted_later and taken(1, shot=first) == []
    (again,) = taken(1, shot=whole)
    assert again.fitted_later and again.shot is whole and taken(1, shot=whole) == []
    (whole_at_once,) = taken(2, shot=whole)
    assert not whole_at_once.fitted_later and taken(2, shot=whole) == []
    (failed,) = taken(3, problem="the disk is full")
    assert failed.problem == "the disk is full" and taken(3, problem="the disk is full") == []


def test_sources_are_listed_with_what_was_found_before_those_that_need_an_address(rig) -> None:
    rig.remember_found([SimpleNamespace(source="scope:1", name="Scope", where="USB port 3")])
    rig.remember_network(["scpi:10.0.0.7"])
    listed = rig.sources()
    names = [source for source, _ in listed]
    place = names.index("scope:1")
    assert listed[place] == ("scope:1", "Scope, USB port 3") and names[place + 1] == "scpi:10.0.0.7"
    assert all(name.endswith(":") for name in names[place + 2 :]) and len(names) > place + 2
    assert not any(name.endswith(":") for name in names[:place]) and "bench" in names[:place]


@pytest.mark.parametrize(("ends", "held", "said"), [(True, True, 0), (False, False, 0), (False, True, 1)])
def test_a_source_that_does_not_let_go_is_said(rig, ends: bool, held: bool, said: int) -> None:
    capture = _runs(rig)
    capture.ends, capture.digitizer_held = ends, held
    rig.open("absent")
    _until(lambda: rig.latest().state is State.FAULT and not rig._thread.tasks and rig._running is None)
    problems = rig.take_problems()
    assert capture.told == [("close", None)] and len(problems) == said
    assert all(problem.startswith("bench?seed=1 did not close in time") for problem in problems)


class Opened(Capture):
    """A capture of a source that opens at once."""

    def __init__(self, digitizer: Any, options: Any, *, numbers: Iterator[int], **_: Any) -> None:
        super().__init__()
        self.told.append(("options", options.name))
        self.numbers = numbers

    def start(self) -> None:
        self.told.append(("start", None))


def test_a_planned_shot_arms_its_own_source_with_its_options_once(monkeypatch) -> None:
    """Also if it is asked for while another source is opening; the next opening is neither armed nor changed."""
    monkeypatch.setattr("instrument.capture.Capture", Opened)
    begun, may_open = threading.Event(), threading.Event()

    def opens(source: str):
        begun.set()
        assert source != "slow" or may_open.wait(20.0)
        return SimpleNamespace(capabilities=SimpleNamespace(channels=(), bits=8), default_settings=lambda: None)

    given = SimpleNamespace(settings=None, name="set")
    rig = Rig(lambda *_: given, AnalysisSettings, SimpleNamespace(), source="slow", open_digitizer=opens)
    assert begun.wait(20.0)
    rig.open("planned", lambda options: SimpleNamespace(settings=None, name="planned"))
    may_open.set()
    _until(lambda: rig.opened == "planned" and rig._running.capture.told[-1] == ("arm", False))
    assert rig._running.capture.told[0] == ("options", "planned")
    first = next(rig._running.capture.numbers)
    rig.open("next")
    _until(lambda: rig.opened == "next")
    assert rig._running.capture.told == [("options", "set"), ("start", None)]
    assert next(rig._running.capture.numbers) == first + 1  # no two shots of one rig have the same number
    assert rig.close()
