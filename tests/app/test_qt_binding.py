"""The Qt binding keeps its books: one that does not ends the program after a few thousand signals."""

import sys

import pytest
from PySide6.QtCore import QObject, Signal


class _Sender(QObject):
    said = Signal()


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="True is immortal from Python 3.12 on")
def test_emitting_a_signal_keeps_the_reference_count_of_true() -> None:
    sender = _Sender()
    before = sys.getrefcount(True)
    for _ in range(200):
        sender.said.emit()
    assert sys.getrefcount(True) > before - 100
