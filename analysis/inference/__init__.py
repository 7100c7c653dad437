"""Parameters from shots: fits, the noise that they are weighed with, and first-order scores of what may be added."""
