"""Parsers' processes that are forked from this one, which has imported what they need."""

import os
import signal
import sys
import time
import warnings
from contextlib import contextmanager, suppress

from seerob.core.files import parser_process

SECONDS = 3.0
"""Computing time that a damaged file gets [s]."""


class _Process:
    """A forked process that answers, with as much of `subprocess.Popen` as is asked of one."""

    def __init__(self):
        questions, answers = os.pipe(), os.pipe()
        self.returncode = None
        self.pid = os.fork()
        if self.pid == 0:
            _be_the_process(questions[0], answers[1])
        os.close(questions[0])
        os.close(answers[1])
        self.stdin, self.stdout = os.fdopen(questions[1], "wb"), os.fdopen(answers[0], "rb")

    def _ended(self, flags):
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, flags)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def poll(self):
        return self._ended(os.WNOHANG)

    def wait(self):
        return self._ended(0)

    def kill(self):
        if self.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)


def _be_the_process(questions, answers):
    try:
        for number, end in enumerate((questions, answers, os.open(os.devnull, os.O_WRONLY))):
            os.dup2(end, number)
        os.closerange(3, 4096)
        sys.stdin, sys.stdout, sys.stderr = os.fdopen(0), os.fdopen(1, "w"), os.fdopen(2, "w")
        sys.argv = [""]
        warnings.simplefilter("ignore")  # no error, as pytest has them: this process is as any user's
        limit = parser_process._limit_time
        parser_process._limit_time = lambda seconds: limit(min(seconds, SECONDS))
        parser_process._main()
    finally:
        os._exit(0)


@contextmanager
def forked():
    """Parsers' processes are forked meanwhile; import what they need before."""

    def begun(self, modules=()):
        del modules  # this process has them
        self.process, self.answered = _Process(), time.monotonic()

    executed = parser_process._Child.__init__
    parser_process._end_all()
    parser_process._Child.__init__ = begun
    try:
        yield
    finally:
        parser_process._Child.__init__ = executed
        parser_process._end_all()
