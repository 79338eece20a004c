"""The way from the configuration of an arena to its `MjSpec` (host)."""
