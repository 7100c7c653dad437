"""The simulated rig: block, plate, optics, photodiodes, light switch and digitizer.

Its physics shares no code with the analysis: it has other coordinates, another integrator and its own list of effects.
Analysing its recordings is therefore an independent test.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
