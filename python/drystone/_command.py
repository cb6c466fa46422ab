"""The command `drystone`."""

import signal
import sys

from . import _drystone


def main() -> None:
    """Run the command with the arguments of the process."""
    # The program handles Ctrl-C itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_drystone.command(["drystone", *sys.argv[1:]]))
