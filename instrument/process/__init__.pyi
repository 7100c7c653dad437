from .subprocess_digitizer import SIMULATED_ANSWER_S, open_in_subprocess
from .subprocess_worker import SubprocessAnalysis, SubprocessWorker

__all__ = [
    "SIMULATED_ANSWER_S",
    "SubprocessAnalysis",
    "SubprocessWorker",
    "open_in_subprocess",
]
