"""`python -m asvhil` is the `asvhil` command."""

from asvhil.commands.cli import main

main()
