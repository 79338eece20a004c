"""How large pictures may be; nothing is imported, so that commands can say so at once."""

SHEET = 250.0
"""The largest sheet of worlds [megapixels]."""
FILM = 8.8
"""The largest picture of a video, which is H.264's [megapixels]."""
