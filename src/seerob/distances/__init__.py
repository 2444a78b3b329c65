"""Questions to the shapes of the scene: least distances, depths and rays."""
