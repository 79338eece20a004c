"""What decides elements of a model: each family of elements that varies is one term, in one file."""
