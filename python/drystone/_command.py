"""The command `drystone`."""

import signal
import sys

from . import _drystone


def main() -> None:
    """Run the command with the words that the process was given."""
    # The program has its own answer to Ctrl-C.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_drystone.command(["drystone", *sys.argv[1:]]))
