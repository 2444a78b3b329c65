"""What ``seerob emulate`` can be: real servers that speak a device's protocol, one file per kind."""
