"""What sources of captured motion share."""
