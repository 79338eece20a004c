"""The way from ranges to the parameters of one world, and from there to free places (device, pure)."""
