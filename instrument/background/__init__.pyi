from .worker_process import ProcessEnded, WorkerProcess, lower_priority
from .worker_thread import Task, Work, WorkerThread, beside, raise_in_thread, start_thread

__all__ = [
    "ProcessEnded",
    "Task",
    "Work",
    "WorkerProcess",
    "WorkerThread",
    "beside",
    "lower_priority",
    "raise_in_thread",
    "start_thread",
]
