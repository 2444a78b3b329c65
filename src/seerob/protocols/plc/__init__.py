"""Protocols of machines and their controllers (PLC)."""
