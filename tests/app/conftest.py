"""The window is driven without a display, its kernels compiled once before."""

import os

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture(scope="session")
def compiled_kernels():
    """Compile, or load from the cache, what the first shot needs; windows opened later in this process have it."""
    from app import session
    from app.session import kernels, warm_up

    assert session.complete is kernels.complete  # the package remembers it as it is before it is replaced
    warm_up.readings()
    warm_up.fit()


@pytest.fixture(scope="module")
def warm_kernels(compiled_kernels):
    """Let windows take the kernels for ready; undone before another module of tests looks at what is exported."""
    from app.session import kernels

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "readings", lambda: None)  # each window would read a made-up shot to load them
        patch.setattr(kernels, "complete", lambda *_: True)  # and, where not all is on disk, compile all
        yield


@pytest.fixture
def appeared(qapp):
    """Return a function that lets something happen and returns the names of the windows that came up meanwhile."""
    from PySide6.QtCore import QEvent, QObject
    from PySide6.QtGui import QWindow

    class Watch(QObject):
        def eventFilter(self, thing, event):
            if event.type() == QEvent.Type.Show and isinstance(thing, QWindow):
                names.append(thing.objectName())
            return False

    names, watch = [], Watch()

    def during(event):
        qapp.installEventFilter(watch)
        event()
        qapp.removeEventFilter(watch)
        return names

    return during
