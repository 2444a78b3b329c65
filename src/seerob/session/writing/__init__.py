"""What the twin may write: off unless the workstation file and the command line both allow it."""
