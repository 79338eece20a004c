"""Worlds that fail: found, kept and replayed."""
