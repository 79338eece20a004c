"""Arenas and worlds as files."""
