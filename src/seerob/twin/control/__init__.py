"""How the twin is pulled toward what was said."""
