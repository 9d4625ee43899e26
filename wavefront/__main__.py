"""`python -m wavefront` is the same as the command `wavefront`."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
