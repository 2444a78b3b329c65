"""What is known of where anybody is."""
