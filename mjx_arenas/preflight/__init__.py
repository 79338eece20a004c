"""What is wrong with a randomized model, before it is used."""
