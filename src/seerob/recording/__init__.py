"""What a run leaves: results over time in bounded memory, and recordings read back."""
