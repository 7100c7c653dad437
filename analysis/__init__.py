"""The analysis from digitizer counts to a report: signal, motion, impact, model, diagnosis, report.

Pure functions on arrays. No Qt, no hardware; only ``resources`` is read from disk.
"""

import os
import sys

# The matrices are small and shots are analysed in parallel.  More BLAS threads would only wait for each other, or for
# another program that occupies a core (22 ms instead of 0.3 ms for a least-squares solution).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if "numpy" in sys.modules:  # numpy has already read the variable
    from threadpoolctl import threadpool_limits

    threadpool_limits(int(os.environ["OPENBLAS_NUM_THREADS"]), user_api="blas")

from analysis.compiled import use_kernel_cache

use_kernel_cache()
