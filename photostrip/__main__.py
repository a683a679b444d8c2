"""``python -m photostrip`` does what ``photostrip`` does."""

import sys

from photostrip.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
