"""``seerob`` and ``python -m seerob``: the command line, and Ctrl-C before it is there and after its end."""

import os
import signal
import sys

from seerob.core.interrupted import stopped


def program() -> int:
    """Run one command; its exit code."""
    # Matrices are small here: a library's threads would keep processors busy by waiting for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        try:
            from seerob.app.cli import main

            return main()
        finally:
            # What is left is the interpreter's own end, which would answer with a traceback.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        return stopped()


if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the folder it is started in, where a kind must find no module
    sys.exit(program())
