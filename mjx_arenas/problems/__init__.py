"""Problems in words: the one place where sentences are made."""
