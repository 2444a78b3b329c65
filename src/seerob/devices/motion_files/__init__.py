"""What sources of trajectory files share."""
