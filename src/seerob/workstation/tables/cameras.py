"""Cameras that look at the cell, in the workstation file."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import urlsplit

from msgspec import Meta

from seerob.core.host_name import check_url
from seerob.core.quantities import Name, Table, unit

LARGEST_ERROR = 0.05
"""Largest error of a camera over whose picture the twin is drawn [m]: our choice, that of a room, too."""


class Camera(Table, frozen=True, kw_only=True):
    """A camera that looks at the real cell: the page shows the twin over its picture."""

    name: Name
    """Its name on the page."""
    calibration: Annotated[str, Meta(min_length=1)]
    """File with its lens and pose, beside this one, as ``seerob calibrate camera`` writes it."""
    address: str | None = None
    """Where its pictures come from: MJPEG over HTTP, ``http://127.0.0.1:8081/stream``, fetched by the engine
    from this machine, or from another that the command line allows (``--allow-camera HOST``). Without it, the
    page asks for a camera of the device that shows it."""
    limit: Annotated[float, unit("m", gt=0, le=1)] = LARGEST_ERROR
    """Largest error at the tool [m], 95 %: the twin is not drawn over the picture of a camera that is off by
    more. The default is our choice."""
    record: bool = False
    """Whether pictures that the engine fetches are put into the recording, too."""

    def __post_init__(self) -> None:
        if self.address is None:
            if self.record:
                raise ValueError("record is of pictures that the engine fetches: give address, too")
            return
        check_url("address", self.address)
        parts = urlsplit(self.address)
        if parts.scheme not in ("http", "https") or not parts.hostname or parts.username is not None:
            what = f"address = {self.address[:80]!r} is no http://HOST:PORT/PATH without a login"
            raise ValueError(f"{what}; other streams can be turned into MJPEG on this machine")
