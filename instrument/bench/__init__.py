"""A rig in the machine: block, plate, optics, photodiodes, light switch and digitizer, made up but honest.

It shares no code with the analysis: other coordinates, another integrator, its own list of effects.  What the
analysis finds in its recordings is therefore found, not recognised.
"""
