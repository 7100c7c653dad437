"""Real digitizers, each behind the contract of ``instrument.digitizer``; none is imported before it is asked for."""
