"""The way from records to batches, data and steps on the device."""
