"""Search of the catalogue: what each effect would explain, and which are fitted together."""
