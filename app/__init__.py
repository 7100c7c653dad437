"""The desktop application and the command line; the only place that imports Qt."""

import os

# The processes it starts never look for modules in the folder it was started from, which may hold anything.
os.environ.setdefault("PYTHONSAFEPATH", "1")
