"""What a run said over time, in bounded memory."""
