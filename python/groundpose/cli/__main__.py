"""`python -m groundpose.cli`: the command line without its script."""

from groundpose.cli.start import main

main()
