"""From a digitizer's samples to saved shots: ring, trigger, ARM, recorder, and who analyses what was taken."""
