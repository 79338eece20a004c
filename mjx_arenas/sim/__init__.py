"""From records to batches, data and steps on the device."""
