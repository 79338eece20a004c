"""MJCF and `MjSpec`: reading, editing, the objects that may stand on tables (host)."""
