"""From a digitizer's samples to saved shots: read, trigger, ARM, record, analyse."""
