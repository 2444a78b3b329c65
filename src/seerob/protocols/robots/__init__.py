"""Protocols of robot controllers."""
