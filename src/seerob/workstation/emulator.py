"""What a device is emulated by: the base of the options of each kind of ``[[emulators]]``.

A workstation file may say which emulators stand for its devices. They are started on demand only
(``seerob run --emulated``), each in a process of its own.
"""

from __future__ import annotations

from msgspec import Struct


class Emulator(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every emulator's options: one file, one class, one ``kind``. The fields are its table."""
