"""The digitizer and long computations in subprocesses, and the messages between the processes."""
