"""Sources, one file per protocol, device or file format; the file name is the ``kind``."""
