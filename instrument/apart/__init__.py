"""A digitizer in a process of its own, so that nothing the screen does can cost samples."""
