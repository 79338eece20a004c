"""What may vary, and its distributions."""
