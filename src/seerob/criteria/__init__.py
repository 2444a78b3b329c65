"""What is judged: safety, ergonomics, and what they share."""
