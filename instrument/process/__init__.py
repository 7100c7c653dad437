"""The digitizer and long work in processes of their own, and how they are talked to."""
