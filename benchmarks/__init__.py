"""What mjx_arenas costs, and what it is compared with: `mjx-arenas bench --list`."""
