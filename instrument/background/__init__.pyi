from .worker_process import ProcessEnded as ProcessEnded
from .worker_process import WorkerProcess as WorkerProcess
from .worker_process import lower_priority as lower_priority
from .worker_thread import Task as Task
from .worker_thread import Work as Work
from .worker_thread import WorkerThread as WorkerThread
from .worker_thread import beside as beside
from .worker_thread import start_thread as start_thread
