"""The way from the rows of terms to the fields of a model, and to the fields that follow from them (device, pure)."""
