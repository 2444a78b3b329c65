"""``python -m seerob``: the command line."""

import sys

from seerob.cli import main

if __name__ == "__main__":
    sys.exit(main())
