"""The engine, the state, and what is known of whom."""
