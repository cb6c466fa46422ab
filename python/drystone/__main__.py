"""`python -m drystone`: the command `drystone`."""

from ._command import main

if __name__ == "__main__":
    main()
