"""`python -m nlbench` is the command `nlbench`."""

from nlbench.cli import main

if __name__ == "__main__":
    main()
