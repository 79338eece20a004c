"""Figures of our own (host)."""

import io

from matplotlib.figure import Figure


class OwnFigure(Figure):
    """A figure that a notebook shows, though no pyplot made it."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png")
        return picture.getvalue()
