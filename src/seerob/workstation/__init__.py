"""The file that the engineer writes: typed, frozen, every mistake at once."""
