"""`python -m polarsim`: the command where its script is not on the path."""

from polarsim.cli import main

if __name__ == "__main__":
    main()
