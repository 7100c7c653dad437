"""How kernels are compiled, cached between runs, and run in parallel."""
