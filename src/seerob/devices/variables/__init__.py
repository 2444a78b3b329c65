"""What sources of machine variables share."""
