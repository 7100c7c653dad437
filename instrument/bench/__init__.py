"""The simulated rig: block, plate, optics, photodiodes, light switch and digitizer.

It shares no code with the analysis, but uses other coordinates, another integrator and its own list of effects, so that
the analysis of its recordings is an independent test.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
