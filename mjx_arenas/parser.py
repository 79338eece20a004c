"""Arguments of modules that are run, with the command line's errors (host)."""

import argparse
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """Answers wrong use by one sentence, as `mjx-arenas` does."""

    def error(self, message: str) -> NoReturn:
        """Ends the process with 2."""
        sentence = message[:1].upper() + message[1:]
        self.exit(2, f"error: {sentence.rstrip('.')}. See {self.prog} --help.\n")
