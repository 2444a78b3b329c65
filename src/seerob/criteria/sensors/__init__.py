"""Protective devices: what the workstation file says of them, their fields, and what they detect."""
