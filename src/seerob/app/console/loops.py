"""The inner loops: whether Numba has compiled them before, and what is done and said when it has not."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Generator, Sequence
from contextlib import closing, suppress
from importlib.util import find_spec
from pathlib import Path
from queue import Queue
from threading import Thread

from seerob.app.console.progress import spinner
from seerob.app.console.terminal import STATUS

COMPILING = "compiling the inner loops, once"
MOST = 4
"""Processes at once, of about 300 MB each; one loop takes a third of all the time."""


def compile_loops() -> None:
    """Compile loops of `seerob.kernels._beforehand` that are not kept as they are now; say how far it is.

    What cannot be compiled here, whatever the reason, is compiled when it is called.
    """
    missing = missing_loops()
    if not missing or not sys.executable or getattr(sys, "frozen", False):
        return
    STATUS.print(f"{COMPILING}: 0 of {len(missing)}", markup=False)
    with spinner() as say, closing(_compiled(missing)) as compiled:
        for done, _ in enumerate(compiled, 1):
            say(f"{COMPILING}: {done} of {len(missing)}")


def missing_loops() -> list[str]:
    """Names in `seerob.kernels._beforehand.LOOPS` of what is not kept as it is now."""
    from seerob.kernels._beforehand import LOOPS
    from seerob.kernels._kept_loops import key_of

    kept = {found.name for folder in cache_folders() if folder.is_dir() for found in folder.glob("*.nbi")}
    end = f".py{sys.version_info.major}{sys.version_info.minor}"

    def is_kept(name: str) -> bool:
        module, function = name.split()
        begin, key = f"{module}.{function}-", f"-{key_of(module)}{end}"
        return any(file.startswith(begin) and key in file for file in kept)

    return [name for name in LOOPS if not is_kept(name)]


def _compiled(names: Sequence[str]) -> Generator[str]:
    """Compile loops in processes side by side; yields the name of each when it is done."""
    waiting, answers = iter(names), Queue[str | None]()
    workers: list[subprocess.Popen[str]] = []

    def share(worker: subprocess.Popen[str]) -> None:
        assert worker.stdin is not None
        assert worker.stdout is not None
        with suppress(OSError):  # it has ended
            for name in waiting:
                worker.stdin.write(f"{name}\n")
                worker.stdin.flush()
                if not worker.stdout.readline():
                    break
                answers.put(name)
        answers.put(None)

    threads: list[Thread] = []
    try:
        for _ in range(min(MOST, os.cpu_count() or 1, len(names))):
            try:
                workers.append(_worker())
            except OSError:  # no process can be started
                break
            threads.append(Thread(target=share, args=workers[-1:], daemon=True))
            threads[-1].start()
        for _ in workers:
            while (name := answers.get()) is not None:
                yield name
    finally:
        for worker in workers:
            worker.kill()
        for thread in threads:
            thread.join()
        for worker in workers:
            with worker:
                pass  # closes its pipes and waits for its end


def _worker() -> subprocess.Popen[str]:
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        (sys.executable, "-P", "-m", "seerob.kernels._beforehand"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
        process_group=0,  # Ctrl-C is for the command, which ends it
    )


def cache_folders() -> list[Path]:
    """Where Numba keeps, or looks for, what it compiled of `seerob.kernels`."""
    spec = find_spec("seerob.kernels")
    assert spec is not None
    assert spec.origin is not None
    package = os.path.dirname(os.path.abspath(spec.origin))
    # As numba.core.caching names the folder of a package in a cache for all of them.
    inner = f"{os.path.basename(package)}_{hashlib.sha1(package.encode(), usedforsecurity=False).hexdigest()}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return [Path(chosen) / inner]
    from platformdirs import user_cache_path

    return [Path(package) / "__pycache__", user_cache_path("numba", appauthor=False) / inner]
