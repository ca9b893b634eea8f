"""`python -m asvhil` is the `asvhil` command."""

from asvhil.cli import main

main()
