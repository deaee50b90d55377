"""Read and write CAN logs and bags."""
