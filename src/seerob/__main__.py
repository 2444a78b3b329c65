"""``seerob`` and ``python -m seerob``: the command line, and Ctrl-C before it is there and after its end."""

import atexit
import os
import signal
import sys
import threading

from seerob.app.console.interruption import stopped


def program() -> int:
    """Run one command; its exit code."""
    # Matrices are small here: a library's threads would keep processors busy by waiting for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        try:
            from seerob.app.cli import main

            code = main()
        finally:
            # What is left is the interpreter's own end, which would answer with a traceback.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        return stopped()
    _end(code)
    return code


def _end(code: int) -> None:
    """End the process without taking it apart, which took half a second of the processor.

    What is to be done at the end is done before. Where threads work on, somebody measures, or what was
    printed cannot be delivered, the interpreter ends as ever.
    """
    working = any(not t.daemon for t in threading.enumerate() if t is not threading.main_thread())
    if working or sys.gettrace() or sys.getprofile():
        return
    atexit._run_exitfuncs()
    try:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
    except (OSError, ValueError):
        return
    os._exit(code)


if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the folder it is started in, where a kind must find no module
    sys.exit(program())
