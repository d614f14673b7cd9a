"""Transforms, cameras and ground models in plain numpy; each module states its conventions at its head."""
