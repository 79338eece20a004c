"""The tasks that come along, and how configurations make them."""
