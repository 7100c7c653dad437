"""ARMING is shown from the press of ARM until the digitizer answers, however quickly it does."""

from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

from analysis.shot.shot import AnalysisSettings
from app.session.rig import Rig
from instrument.capture.acquisition import State


@contextmanager
def _rig(answers):
    """Give a rig whose capture has ``answers`` when it is told to arm."""

    def refused(*_, **__):
        raise OSError("no device in this test")

    now = [100.0]
    rig = Rig(lambda *_: None, AnalysisSettings, SimpleNamespace(), open_digitizer=refused, clock=lambda: now[0])
    rig._thread.join(0.2)
    shown = [replace(rig.latest(), state=State.IDLE, since_s=90.0)]

    def arm(*, automatic):
        if answers:
            now[0] += 0.001
            shown[0] = replace(shown[0], state=State.ARMED, since_s=now[0])

    rig._running = SimpleNamespace(capture=SimpleNamespace(arm=arm, latest=lambda: shown[0]))
    yield rig
    rig._running = None
    rig.close()


def test_a_digitizer_that_answers_at_once_is_not_awaited():
    with _rig(answers=True) as rig:
        rig.arm()
        assert not rig.arming(rig.latest())
        assert rig.latest().state is State.ARMED


def test_one_that_has_not_answered_is():
    with _rig(answers=False) as rig:
        rig.arm()
        assert rig.arming(rig.latest()) and not rig.can_arm(rig.latest())


def test_nothing_is_left_running():
    with _rig(answers=True) as rig:
        thread = rig._thread
    thread.join(5.0)
    assert not thread.is_alive()
