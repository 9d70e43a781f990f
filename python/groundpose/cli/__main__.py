"""`python -m groundpose.cli`: the command line without its script."""

from groundpose.cli.main import main

main()
