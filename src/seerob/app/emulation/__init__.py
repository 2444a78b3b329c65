"""What emulators share: their base, their options, motions and people to play."""
