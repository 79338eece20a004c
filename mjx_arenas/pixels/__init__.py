"""What cameras see, in every world, on the device."""

from mjx_arenas.pixels import images as images
