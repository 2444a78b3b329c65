"""From a workstation to files that other programs read."""
