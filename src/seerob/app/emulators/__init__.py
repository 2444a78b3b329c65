"""Small real servers that speak a controller's protocol: for a demo without hardware, and for tests."""
