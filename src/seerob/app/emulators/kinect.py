"""The sender of a depth camera's PC without a camera: sends moving persons over a real socket."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from seerob.app.emulation.kinect_person import Scene, animated, recorded
from seerob.app.emulation.message_sender import MessageSender, Way
from seerob.app.emulation.options import LIBRARY, EmulatorOptions, Ready, option, port
from seerob.protocols.tracking.kinect import PORT, encode_message

FIRST = 1.0
"""The camera's clock at the first picture [s]; it counts from when it was switched on."""


class KinectSender(MessageSender):
    """The sender, in threads of its own.

    Args:
        scene: What the camera sees; time counts from the start of the sender.
        to: Address and port that datagrams go to; None for a WebSocket that others connect to.
        host: Own address to listen on, with a WebSocket.
        port: Own port to listen on, with a WebSocket; 0 is any free one.
        rate: Pictures per second [Hz].
        way: What happens to each message on the way.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        to: tuple[str, int] | None = ("127.0.0.1", PORT),
        host: str = "127.0.0.1",
        port: int = PORT,
        rate: float = 30.0,
        way: Way | None = None,
    ) -> None:
        super().__init__(to=to, host=host, port=port, rate=rate, way=way)
        self.scene = scene

    def message(self, k: int) -> bytes:
        """The message of a picture."""
        picture = self.scene(k / self.rate)
        return encode_message(replace(picture, t=FIRST + k / self.rate, frame=k))


# -- options ------------------------------------------------------------------------------------

CONNECT = "seerob probe kinect --set link=websocket --set host={host} --port {port}"
"""How one that listens is heard."""
_FILE = "a recording of a body tracker (.json, .bag, .csv …), or keyframes (.toml, library:…)"


class Kinect(EmulatorOptions, frozen=True, kw_only=True):
    """The sender beside a depth camera (Azure Kinect, Orbbec), which sees a moving person."""

    file: Annotated[str, option(_FILE)] = LIBRARY
    subject: Annotated[str, option("which body of a recording")] = ""
    to: Annotated[str, option("address to send datagrams to")] = "127.0.0.1"
    port: Annotated[int, port("port to send to, or to listen at with --websocket")] = PORT
    rate: Annotated[float, option("pictures per second", "Hz", ge=1, le=60)] = 30.0
    websocket: Annotated[bool, option("let listeners connect; else UDP")] = False

    def ready(self) -> Ready:
        """The sender."""
        keyframes = self.file.startswith("library:") or self.file.endswith(".toml")
        scene = animated(self.file) if keyframes else recorded(Path(self.file), self.subject)
        to = None if self.websocket else (self.to, self.port)
        server = KinectSender(scene, to=to, host=self.host, port=self.port, rate=self.rate)
        where = self.host if self.websocket else self.to
        hear = (CONNECT,) if self.websocket else ()
        return Ready(server, f"a person, {self.file}", f"{where}:{self.port}", hear)
