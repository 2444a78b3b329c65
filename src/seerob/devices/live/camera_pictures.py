"""Pictures of network cameras: the newest of each, fetched while somebody looks at them or records them.

Each camera has a thread of its own, which connects anew when it is cut off. Only the newest picture is held.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from threading import Event, Lock, Thread
from time import monotonic
from types import TracebackType
from typing import NamedTuple, Self
from urllib.parse import urlsplit

from seerob.core.host_name import is_loopback
from seerob.core.printable import printable
from seerob.protocols import ProtocolError
from seerob.protocols.links.mjpeg import boundary, pictures, size_of

TIMEOUT = 5.0
"""Without a byte for so long, a camera is connected to anew [s]."""
AGAIN = 2.0
"""Between two attempts [s]."""
WANTED = 10.0
"""After the last look a camera is asked for pictures so long [s]."""

_log = logging.getLogger(__name__)


class Picture(NamedTuple):
    """One picture of a camera."""

    number: int
    """From 1; another than the one before it."""
    at: float
    """When it was here, monotonic time [s]; when it was taken, no camera says."""
    jpeg: bytes


def allowed(address: str, hosts: Sequence[str]) -> bool:
    """Whether a camera may be connected to: it is on this machine, or its host was allowed."""
    host = urlsplit(address).hostname or ""
    return is_loopback(host) or host in {each.lower() for each in hosts}


class CameraPictures:
    """One camera; `newest` may be called from any thread.

    Args:
        address: ``http://…`` of its MJPEG.
        size: Width and height that its lens was found for [px].
        always: Whether it is asked for pictures also while nobody looks, because they are recorded.
    """

    def __init__(self, address: str, size: tuple[int, int], *, always: bool = False) -> None:
        self._address, self._size, self._always = address, size, always
        self._lock = Lock()
        self._picture: Picture | None = None
        self._reason = "its camera has not answered yet"
        self._until = 0.0
        self._wanted, self._over = Event(), Event()
        self._listeners: list[Callable[[], None]] = []
        self._connection: HTTPConnection | None = None
        self._thread = Thread(target=self._run, name="seerob camera", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._wanted.set()
        with self._lock:
            connection = self._connection
        if connection is not None and connection.sock is not None:
            connection.sock.close()
        self._thread.join(2 * TIMEOUT)

    def newest(self, tell: Callable[[], None] | None = None, after: int = 0) -> Picture | str:
        """The newest picture, or why there is none; asks for more of them from now on.

        Args:
            tell: Called once, in another thread, when there is another than the one numbered ``after``.
            after: Number of the one that is known.
        """
        with self._lock:
            self._until = monotonic() + WANTED
            self._wanted.set()
            found = self._picture
            if tell is not None and (found is None or found.number == after):
                self._listeners.append(tell)
            return found if found is not None else self._reason

    def _run(self) -> None:
        while not self._over.is_set():
            if not (self._always or monotonic() < self._until):
                self._wanted.clear()
                self._wanted.wait()
                continue
            try:
                self._fetch()
                reason = "its camera ended the stream"
            except (OSError, HTTPException, ProtocolError, ValueError) as error:
                reason = f"its camera: {printable(str(error))[:200] or type(error).__name__}"
            if self._over.is_set():
                return
            with self._lock:
                said, self._reason, self._picture = self._reason, reason, None
            if reason != said:
                _log.warning("%s: %s", self._address, reason)
            self._tell()
            self._over.wait(AGAIN)

    def _fetch(self) -> None:
        """Take pictures until nobody wants any, or the stream ends.

        Raises:
            OSError: No connection, or nothing for too long.
            HTTPException: No HTTP.
            ProtocolError: No stream of JPEG pictures, or of another size than the lens.
        """
        parts = urlsplit(self._address)
        kind = HTTPSConnection if parts.scheme == "https" else HTTPConnection
        connection = kind(parts.hostname or "", parts.port, timeout=TIMEOUT)
        with self._lock:
            self._connection = connection
        try:
            path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
            connection.request("GET", path, headers={"Accept": "multipart/x-mixed-replace"})
            answer = connection.getresponse()
            if answer.status != 200:  # also of a redirection, which is not followed
                raise ProtocolError(f"answers with HTTP {answer.status}")
            for jpeg in pictures(answer, boundary(answer.getheader("Content-Type", ""))):
                width, height = size_of(jpeg) or (0, 0)
                if (width, height) != self._size:
                    is_of = f"its lens is known for {self._size[0]} × {self._size[1]} px"
                    raise ProtocolError(f"pictures of {width} × {height} px, and {is_of}")
                with self._lock:
                    number = 1 if self._picture is None else self._picture.number + 1
                    self._picture = Picture(number, monotonic(), jpeg)
                self._tell()
                if self._over.is_set() or not (self._always or monotonic() < self._until):
                    return
        finally:
            connection.close()
            with self._lock:
                self._connection = None

    def _tell(self) -> None:
        with self._lock:
            listeners, self._listeners = self._listeners, []
        for tell in listeners:
            tell()


class Cameras:
    """Cameras of a run by their number in the scene, for the page and for whoever records."""

    def __init__(self, of: dict[int, CameraPictures], recorded: dict[str, CameraPictures]) -> None:
        self.of = of
        """By number, of those that are fetched."""
        self._recorded = recorded
        self._taken: dict[str, float] = {}

    def taken(self) -> list[tuple[str, bytes]]:
        """Pictures to record that are newer than those of the last call, with the names of their cameras."""
        found = []
        for name, camera in self._recorded.items():
            picture = camera.newest()
            if isinstance(picture, Picture) and self._taken.get(name) != picture.at:
                self._taken[name] = picture.at
                found.append((name, picture.jpeg))
        return found
