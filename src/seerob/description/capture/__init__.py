"""From what a device says of a person to the posture that the twin follows."""
