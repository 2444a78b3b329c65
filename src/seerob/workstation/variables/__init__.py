"""What the variables of controllers and machines mean."""
