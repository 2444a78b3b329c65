"""What a program that Ctrl-C ended says, and its exit code."""

import sys

EXIT = 3


def stopped() -> int:
    """Say that it was stopped; its exit code."""
    # An interrupt inside text that a library had run makes the interpreter end by a signal instead of with
    # our exit code, until other text is run.
    eval("0")  # noqa: S307
    sys.stderr.write("stopped\n")
    return EXIT
