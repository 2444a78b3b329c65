"""What commands share: the terminal, progress, interruption, loading."""
