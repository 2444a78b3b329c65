"""Files of motion capture, in and out: one module per format; what is read becomes `Captured`."""
