"""HTTP and WebSocket: snapshots out, commands in."""
