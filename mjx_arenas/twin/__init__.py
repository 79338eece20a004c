"""The same worlds in C MuJoCo (host)."""
