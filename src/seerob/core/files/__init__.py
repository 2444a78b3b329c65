"""Files as users write them, and as a run leaves them: whole or not at all."""
