"""How far what is known may be off, and what that makes of distances and masses."""
