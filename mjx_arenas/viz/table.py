"""Rows of text (host)."""

from collections.abc import Sequence


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Rows of text under each other, without columns that hold nothing."""
    columns = [column for column in zip(*rows, strict=True) if any(column[1:])]
    widths = [max(map(len, column)) for column in columns]
    lines = (
        "  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)) for row in zip(*columns, strict=True)
    )
    return "\n".join(line.rstrip() for line in lines)
