"""What every reader of meshes gets and gives."""
