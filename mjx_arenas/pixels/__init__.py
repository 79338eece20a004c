"""What cameras see, in every world, on the device."""
