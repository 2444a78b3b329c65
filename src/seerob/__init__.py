"""Twin-based safety and ergonomics evaluation of cobotic workstations."""
