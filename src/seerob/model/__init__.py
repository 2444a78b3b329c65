"""The compiled workstation: one MjModel, names → indices, volumes."""
