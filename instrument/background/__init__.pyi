from .worker_process import ProcessEnded, WorkerProcess, lower_priority
from .worker_thread import Task, Work, WorkerThread, beside, start_thread

__all__ = [
    "ProcessEnded",
    "Task",
    "Work",
    "WorkerProcess",
    "WorkerThread",
    "beside",
    "lower_priority",
    "start_thread",
]
