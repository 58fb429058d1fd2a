"""`python -m tests.fuzz`."""

from .command import main

main()
