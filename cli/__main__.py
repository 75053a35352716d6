"""`python -m wamnet.cli`: the command `wamnet` where its script is not on the path."""

import sys

from .entry import run

# Processes that share the rendering import this module again, and must not start the command again.
if __name__ == "__main__":
    sys.exit(run())
