"""The desktop application and the command line; the only place that imports Qt."""

import os

# Subprocesses must not import modules from the working folder, which may contain anything.
os.environ.setdefault("PYTHONSAFEPATH", "1")
