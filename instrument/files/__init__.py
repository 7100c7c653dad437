"""Files, read without trust and written safe from a crash: recordings, motion records, laws, foreign formats."""
