"""The simulated rig: block, plate, optics, photodiodes, light switch and digitizer.

It shares no code with the analysis, but uses other coordinates, another integrator and its own list of effects, so that
the analysis of its recordings is an independent test.
"""
