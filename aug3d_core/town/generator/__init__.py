"""Build the town: its plan, terrain, streets, buildings and textures."""
