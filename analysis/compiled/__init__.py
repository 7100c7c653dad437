"""How kernels are compiled, kept between runs, and run side by side on the cores there are."""
