"""From counts to conclusions: signal, motion, impact, model, diagnosis, report.

Pure functions on arrays. No Qt, no hardware; nothing is read from disk but ``resources``.
"""

import os
import sys

# The matrices are small and shots are worked on side by side: more threads of the algebra only wait for each other,
# and where another program has a core, for that program (22 ms instead of 0.3 ms for a least-squares solution).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if "numpy" in sys.modules:  # it has read that variable already
    from threadpoolctl import threadpool_limits

    threadpool_limits(int(os.environ["OPENBLAS_NUM_THREADS"]), user_api="blas")

from analysis.compiled import use_kernel_cache

use_kernel_cache()
