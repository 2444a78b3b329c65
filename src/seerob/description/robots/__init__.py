"""The robot library, and what is known of one very robot."""
