"""How fast a robot may go along its path, a motion that keeps to it, and what it costs."""
