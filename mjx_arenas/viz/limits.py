"""How large pictures may be; nothing is imported, so that commands can say so at once."""

SHEET = 250.0
"""Of a sheet of worlds [megapixels]."""
FILM = 8.8
"""Of a video: H.264's largest picture [megapixels]."""
