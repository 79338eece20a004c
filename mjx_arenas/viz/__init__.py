"""Worlds in pictures, words and tables."""
