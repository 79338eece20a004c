"""The compiled arena as one frozen record, and the proof that its worlds are what MuJoCo compiles (host)."""
