"""What is known of where anybody is, and what is said of those that are not, or only partly, seen."""
