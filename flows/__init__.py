"""Composition and the command line. The arithmetic is in `aug3d_core`, caching and reporting in `tasks`."""
