"""`python -m mjx_arenas`."""

from mjx_arenas import cli

cli.run()
