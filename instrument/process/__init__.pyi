from .messages import lower_priority
from .subprocess_digitizer import open_in_subprocess
from .subprocess_worker import SubprocessAnalysis, SubprocessWorker

__all__ = [
    "SubprocessAnalysis",
    "SubprocessWorker",
    "lower_priority",
    "open_in_subprocess",
]
