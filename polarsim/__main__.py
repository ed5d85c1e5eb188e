"""Entry point of `python -m polarsim`."""

from polarsim.cli import main

if __name__ == "__main__":
    main()
