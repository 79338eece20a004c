"""From the rows that terms push to the fields of a model, those that follow from them too (device, pure)."""
