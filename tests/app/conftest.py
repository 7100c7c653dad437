"""The window is driven without a display, its kernels compiled once before."""

import os

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture(scope="session")
def warm_kernels():
    """Compile, or load from the cache, what the first shot needs."""
    from app.warm import Kernels

    Kernels().work(lambda what, share: None, lambda: False)
