"""From counts to conclusions: signal, motion, impact, model, diagnosis, report.

Pure functions on arrays. No Qt, no hardware; nothing is read from disk but ``resources``.
"""

from analysis import kernel_cache

kernel_cache.keep_true()
