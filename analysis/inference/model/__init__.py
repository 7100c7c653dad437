"""One shot under a base model with effects: its averaged samples, parameters, displacement and derivatives."""
