"""The command ``levimass``: run the window or a mode without screen; exit status, Ctrl-C and broken pipes."""

import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence

from app.command_line.modes import run_of
from app.command_line.parser import parse
from app.words import PlainStream

OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status (0 analysed, 1 something failed, 2 wrong usage)."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):  # a character that the terminal lacks must not end a script
        sys.stdout.reconfigure(errors="backslashreplace")
    with _plain_streams():
        return _status(arguments)


def _status(arguments: Sequence[str]) -> int:
    try:
        with _ended_by_ctrl_c():
            run = run_of(parse(list(arguments)), arguments)
        status = run()
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except SystemExit as stop:
        return int(stop.code or 0)
    except KeyboardInterrupt:
        print("levimass: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader has seen enough
        _drop_output()
        return OK
    except OSError as error:
        if error.filename is not None:
            raise
        print(f"levimass: standard output: {error.strerror or error}", file=sys.stderr)
        _drop_output()
        return FAILED


@contextlib.contextmanager
def _plain_streams() -> Iterator[None]:
    """Escape control characters of file names and notes before they reach a terminal."""
    with contextlib.ExitStack() as undo:
        for stream, redirect in (
            (sys.stdout, contextlib.redirect_stdout),
            (sys.stderr, contextlib.redirect_stderr),
        ):
            if stream is not None:  # a program without a console has none
                undo.enter_context(redirect(PlainStream(stream)))  # type: ignore[type-var]
        yield


@contextlib.contextmanager
def _ended_by_ctrl_c() -> Iterator[None]:
    """Let Ctrl-C end the process at once while modules are imported: an interrupted import may raise anything."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _drop_output() -> None:
    """Keep the interpreter from writing its buffer once more at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    raise SystemExit(main())
