"""What mjx_arenas costs, and what it is compared with: `python -m benchmarks --list`."""
