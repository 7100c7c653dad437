"""Files, checked when read and written safe from a crash: recordings, motion records, laws, foreign formats."""
