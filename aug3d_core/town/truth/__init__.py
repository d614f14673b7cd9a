"""Compare reconstructions with the town: poses, mesh, overlap, buildings; and small exact worlds."""
