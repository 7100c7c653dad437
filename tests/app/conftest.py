"""The window is driven without a display."""

import os

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
