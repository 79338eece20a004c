"""What is right and wrong about arguments, ranges and worlds: flags on the device, problems on the host."""
