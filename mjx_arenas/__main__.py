"""`python -m mjx_arenas`."""

from mjx_arenas import cli

if __name__ == "__main__":  # processes that training starts import this, too
    cli.run()
