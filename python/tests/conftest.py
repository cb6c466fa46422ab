"""Settings of all tests."""

import signal

# A shell that starts a command in the background lets it ignore SIGINT, and Python then leaves it so: tests of Ctrl-C would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)
