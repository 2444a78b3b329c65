"""A page that floods, in a process of its own, which imports nothing of seerob: there are six at once."""

import socket
import time


def flood(port, seconds, messages):
    """Send as fast as the other end reads; how many were sent."""
    upgrade = (
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n"
        "Sec-WebSocket-Protocol: seerob.v2.msgpack\r\n\r\n"
    ).encode()
    end, sent = time.monotonic() + seconds, 0
    with socket.create_connection(("127.0.0.1", port)) as s:
        s.sendall(upgrade)
        s.recv(4096)
        s.settimeout(0.1)
        while time.monotonic() < end:
            try:
                sent += s.send(messages)
            except TimeoutError:
                continue
            except OSError:
                break
    return sent
