"""The sender of a depth camera's PC without a camera: sends moving persons over a real socket."""

from __future__ import annotations

from dataclasses import replace

from seerob.app.emulators.kinect_person import Scene
from seerob.app.emulators.message_sender import MessageSender, Way
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
