"""What the variables of controllers and machines mean, and their newest values."""
