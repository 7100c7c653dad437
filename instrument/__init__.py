"""Digitizers, light switch, recording: counts in, Recording out. No Qt, no fit, no restitution."""

import analysis as _analysis  # sets the kernel cache before any kernel of this package is compiled

__all__: list[str] = []
del _analysis
