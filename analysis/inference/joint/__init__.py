"""Several shots under one model: their data, one vector of their parameters, and chi^2 weighted by a noise."""
